"""The machine file as a whole."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from stiffmap.model.description import TASK
from stiffmap.model.files.schema.base import (
    BoxModel,
    EachOnce,
    FileModel,
    FrameModel,
    HomeModel,
    Name,
    Noted,
    Number,
    Numbers,
    Source,
    Vector3,
)
from stiffmap.model.files.schema.elements import BodyModel, CableModel, ElementModel, OffsetModel, PointModel
from stiffmap.model.files.schema.springs import MaterialModel

Components = Annotated[list[Literal[TASK]], Field(min_length=1), EachOnce]  # type: ignore[valid-type]


class UnitsModel(FileModel):
    """Units of every number in the file; derived units follow (compliance in mm/N, ...).
    Stiffness and compliance are always per radian, gravity always in m/s²."""

    length: Literal["m", "cm", "mm", "um", "in"]
    force: Literal["N", "kN", "MN"]
    angle: Literal["rad", "deg"]
    mass: Literal["kg", "g", "t"] = "kg"


class LegModel(Noted):
    """A chain from the base to the platform, from a template or written out.

    ``frame`` places the leg's first frame in the base. ``attach`` is the platform frame seen from
    the leg's last frame; ``base_axes`` turns back by the rotation of ``frame``.
    ``home`` gives home coordinates of single joints where they differ from the template's.
    """

    template: Name | None = None
    elements: list[ElementModel] | None = None
    frame: FrameModel | None = None
    attach: Literal["base_axes"] | FrameModel | None = None
    home: dict[str, Number | Numbers] | None = None
    parameters: dict[str, Number] | None = Field(
        default=None, alias="with", description="Parameters of the template."
    )

    @model_validator(mode="after")
    def _one_chain(self) -> LegModel:
        if (self.template is None) == (self.elements is None):
            raise ValueError("give exactly one of template and elements")
        if self.parameters is not None:
            raise ValueError("with: this leg's template has no parameters")
        return self


class TemplateModel(FileModel):
    """A template with parameters: ``$name`` in its elements stands for the number that a leg gives under
    ``with``, else for the one here (nothing: every leg must give it). Legs are written out before the file is
    read, see `stiffmap.model.files.templates`."""

    parameters: dict[str, Number | None] = Field(default_factory=dict)
    elements: list[dict[str, Any]]


AnyTemplate = Annotated[
    Annotated[list[ElementModel], Tag("plain")] | Annotated[TemplateModel, Tag("with_parameters")],
    Discriminator(lambda data: "with_parameters" if isinstance(data, (dict, TemplateModel)) else "plain"),
]


class ExternalSpringModel(Noted):
    """Straight spring from a point of the machine to an anchor fixed in base axes."""

    point: str
    anchor: Vector3
    stiffness: Number
    length: Number
    tension_only: bool = False


class EffectModel(FileModel):
    """Record of an effect added to the machine; its parameters are in SI units."""

    kind: str
    element: str
    legs: Annotated[list[Name], EachOnce] = Field(default_factory=list)
    parameters: dict[str, Annotated[float, Field(allow_inf_nan=False)]] = Field(default_factory=dict)
    options: dict[str, str] = Field(default_factory=dict)


class MachineFile(FileModel):
    """A machine: base, legs in parallel, platform; the platform's last frame is the TCP."""

    name: Name
    title: str = ""
    source: str = ""
    units: UnitsModel
    gravity: Annotated[Vector3, Field(description="m/s², base axes; left out: none.")] | None = None
    home: HomeModel | None = None
    task: Components = Field(
        default_factory=lambda: list(TASK),
        description="Pose components that are commanded; left out: all. Translations along base axes, "
        "rotations about the axes of the commanded TCP frame.",
    )
    workspace: BoxModel | None = None
    materials: dict[Name, MaterialModel] = Field(default_factory=dict)
    templates: dict[Name, AnyTemplate] = Field(default_factory=dict)
    base: list[ElementModel] = Field(default_factory=list)
    legs: dict[Name, LegModel] = Field(default_factory=dict)
    freedoms: Components = Field(
        default_factory=lambda: list(TASK),
        description="Components in which the platform of a machine without legs can move; left out: all. "
        "Guides hold the others.",
    )
    platform: list[ElementModel] = Field(default_factory=list)
    modal_damping: Annotated[
        Number | list[Number] | None,
        Field(
            description="Damping ratios of the modes, lowest frequency first; the last holds for all further ones."
        ),
    ] = None
    external_springs: dict[Name, ExternalSpringModel] = Field(default_factory=dict)
    effects: list[EffectModel] = Field(default_factory=list)
    uncertainty: dict[str, float] = Field(
        default_factory=dict, description="Standard uncertainties by full name, SI; written on saving."
    )
    sources: dict[str, Source] = Field(
        default_factory=dict,
        description="Where numbers come from, by full name; a name may hold '*'. What an element says itself goes first.",
    )
    notes: dict[str, str] = Field(default_factory=dict)
    extra: dict[str, Any] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _carried(self) -> MachineFile:
        if self.legs:
            return self
        if not any(isinstance(e, CableModel) for e in self.platform):
            raise ValueError("expected legs, or cables in the platform; found neither")
        rigid = (OffsetModel, BodyModel, PointModel, CableModel)
        for sequence, kinds in (("base", rigid[1:3]), ("platform", rigid)):
            for e in getattr(self, sequence):
                if not isinstance(e, kinds):
                    *known, found = (k.__name__.removesuffix("Model").lower() for k in (*kinds, type(e)))
                    raise ValueError(f"without legs, {sequence} has {', '.join(known)} only; found {found}")
        return self
