"""Elements of a chain as a file writes them: each is a mapping whose first key says its sort."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, create_model, model_validator

from stiffmap.model.description import Body, Cable, CommandError, Drive, Joint, Point, Spring
from stiffmap.model.description.numbers import DIRECTIONS, DeclaredNumber, numbers_of
from stiffmap.model.files.schema.base import (
    Axis,
    FileModel,
    FrameModel,
    Name,
    Noted,
    Number,
    Numbers,
    Pair,
    Vector3,
)
from stiffmap.model.files.schema.springs import Beam, LawModel, Matrix, Stroke

SORTS = ("offset", "joint", "actuator", "spring", "body", "point", "block", "cable")
SHAPES: dict[str, Any] = {
    "": Number,
    "interval": Pair,
    "vector": Vector3,
    "knots": list[Pair],
    "directions": Annotated[list[Number], Field(min_length=6, max_length=6)],
}
AXES_OF = {"revolute": 1, "prismatic": 1, "universal": 2, "spherical": 3}


def _keys(
    name: str, numbers: dict[str, DeclaredNumber], base: type[FileModel] = FileModel
) -> type[FileModel]:
    """A mapping with keys of these numbers; those with a dot in their key in mappings of their own."""
    keys: dict[str, Any] = {}
    inner: dict[str, dict[str, DeclaredNumber]] = {}
    for key, n in numbers.items():
        outer, _, rest = key.partition(".")
        if rest:
            inner.setdefault(outer, {})[rest] = n
        else:
            keys[key] = (SHAPES[n.shape] | None, Field(default=None, description=n.doc or None))
    keys |= {k: (_keys(k.capitalize(), v) | None, None) for k, v in inner.items()}
    return create_model(name, __base__=base, **keys)


def _numbers(*holders: type, passive: bool = False, base: type[FileModel] = Noted) -> type[FileModel]:
    """Keys of the numbers that these declare, all or those that a passive joint has; those that a file must have and
    those of each axis have rules of their own, below."""
    found = [n for holder in holders for n in numbers_of(holder) if n.passive or not passive]
    return _keys("Numbers", {n.key: n for n in found if not n.needed and n.shape != "axes"}, base)


class OffsetModel(FrameModel, Noted):
    """Constant transform; ``actual`` is what the machine was built with, if not the nominal."""

    offset: Name
    actual: FrameModel | None = None


class JointModel(_numbers(Joint, passive=True)):  # type: ignore[misc]
    """Passive joint; it turns or slides freely unless it has a stiffness or a law, for all axes or a list with
    one per axis. ``rest`` is the coordinate at which these are free of force (left out: as at home)."""

    joint: Name
    kind: Literal["revolute", "prismatic", "universal", "spherical"]
    axis: Axis | None = None
    axes: list[Axis] | None = None
    home: Number | Numbers | None = None
    stiffness: Number | Numbers | None = None
    compliance: Number | Numbers | None = None
    law: LawModel | None = None
    rest: Number | Numbers | None = None

    @model_validator(mode="after")
    def _axes(self) -> JointModel:
        needed = AXES_OF[self.kind]
        given = [self.axis] if self.axis is not None else self.axes
        if (self.axis is not None and self.axes is not None) or given is None or len(given) != needed:
            what = "one axis" if needed == 1 else f"axes: a list of {needed}"
            raise ValueError(f"a {self.kind} joint needs {what}")
        for key in ("home", "rest", "stiffness", "compliance"):
            value = getattr(self, key)
            whole = key in ("stiffness", "compliance")  # one number then holds for every axis
            if isinstance(value, list) and len(value) != needed:
                what = "one number" if needed == 1 else f"{needed} numbers"
                raise ValueError(f"{key} needs {what}")
            if isinstance(value, Number) and needed != 1 and not whole:
                raise ValueError(f"{key} needs a list of {needed} numbers")
        one_of(self, ("stiffness", "compliance", "law"))
        if self.rest is not None and self.stiffness is None and self.compliance is None and self.law is None:
            raise ValueError("rest needs a stiffness, a compliance or a law")
        return self


class CommandErrorModel(_numbers(CommandError, base=FileModel)):  # type: ignore[misc]
    """Error added to the commanded coordinate u: offset + slope*(u - reference) + amplitude*sin(...), and the
    axis positioning error at u by ``knots``: [coordinate, error] by rising coordinate."""


class ActuatorModel(_numbers(Joint, Drive)):  # type: ignore[misc]
    """Actuated joint, one axis; give its stiffness, its compliance, a law, or ``rigid: true``."""

    actuator: Name
    kind: Literal["revolute", "prismatic"]
    axis: Axis
    home: Number | None = None
    stiffness: Number | None = None
    compliance: Number | None = None
    law: LawModel | None = None
    rigid: Literal[True] | None = None
    command_errors: list[CommandErrorModel] | None = None
    coupled: dict[Name, float] | None = Field(
        default=None,
        description="What the controller shows of this joint is its coordinate less these shares of other drives' coordinates.",
    )

    @model_validator(mode="after")
    def _one_law(self) -> ActuatorModel:
        one_of(self, ("stiffness", "compliance", "law", "rigid"), required=True)
        return self


class CableModel(_numbers(Cable, Drive)):  # type: ignore[misc]
    """Cable or belt from the current frame to an anchor in the base; its winch commands its free length. Give its
    elasticity (EA), a stiffness, or both. ``force`` is the largest tension."""

    cable: Name
    anchor: Annotated[Vector3, Field(description="Where it enters its guide, base axes.")]
    guide: Annotated[Axis | None, Field(description="Axis about which the pulley turns, base axes.")] = None
    command_errors: list[CommandErrorModel] | None = None

    @model_validator(mode="after")
    def _yields(self) -> CableModel:
        if getattr(self, "elasticity", None) is None and getattr(self, "stiffness", None) is None:
            raise ValueError("a cable needs an elasticity (EA) or a stiffness")
        return self


class SpringModel(_numbers(Spring)):  # type: ignore[misc]
    """Virtual spring of a link, at the place where its compliance holds."""

    spring: Name
    compliance: Matrix | None = None
    stiffness: Matrix | None = None
    beam: Beam | None = None
    link: Annotated[str, Field(description="Identified link file, relative to this file.")] | None = None
    laws: dict[Literal[DIRECTIONS], LawModel] | None = None  # type: ignore[valid-type]
    stroke: Stroke | None = None

    @model_validator(mode="after")
    def _one_form(self) -> SpringModel:
        table = self.stroke is not None and self.stroke.table is not None
        one_of(self, ("compliance", "stiffness", "beam", "link"), required=not table)
        also = [
            k for k in ("compliance", "stiffness", "beam", "link", "laws") if getattr(self, k) is not None
        ]
        refused = also if table else [k for k in ("stiffness", "laws") if self.stroke and k in also]
        if refused:
            what = "a table" if table else "length and joint"
            raise ValueError(f"a stroke by {what} does not go with {', '.join(refused)}")
        if self.stroke is not None and not table and self.beam is None:
            missing = [k for k in ("length", "along") if getattr(self.stroke, k) is None]
            if missing:
                raise ValueError(f"without a beam, a stroke needs {' and '.join(missing)}")
        return self


class BodyModel(_numbers(Body)):  # type: ignore[misc]
    """Rigid body that moves with the current frame; of a link with a section, mass, centre and inertia follow from it
    where they are not given."""

    body: Name
    of: Annotated[Name | None, Field(description="Spring of the same sequence whose beam it is.")] = None
    inertia: list[Number | Vector3] | None = None

    @model_validator(mode="after")
    def _mass(self) -> BodyModel:
        if getattr(self, "mass", None) is None and self.of is None:
            raise ValueError("a body needs a mass, or of: the spring whose beam it is")
        return self


class PointModel(_numbers(Point)):  # type: ignore[misc]
    """Named point that moves with the current frame."""

    point: Name


class BlockModel(Noted):
    """Two or more branches between the same two frames."""

    block: Name
    branches: Annotated[dict[Name, list[ElementModel]], Field(min_length=2)]


def one_of(model: FileModel, keys: tuple[str, ...], *, required: bool = False) -> None:
    """Refuse two of ``keys`` together, and none of them where one is required."""
    given = [k for k in keys if getattr(model, k) is not None]
    if len(given) > 1 or (required and not given):
        how = "exactly one" if required else "at most one"
        raise ValueError(f"give {how} of {', '.join(keys)}; found {', '.join(given) or 'none'}")


def sort_of(data: object) -> str | None:
    """Sort of an element, as plain data or read; None where it has no key that says it, or several."""
    keys = data if isinstance(data, dict) else getattr(type(data), "model_fields", ())
    found = [k for k in SORTS if k in keys]
    return found[0] if len(found) == 1 else None


ElementModel = Annotated[
    Annotated[OffsetModel, Tag("offset")]
    | Annotated[JointModel, Tag("joint")]
    | Annotated[ActuatorModel, Tag("actuator")]
    | Annotated[SpringModel, Tag("spring")]
    | Annotated[BodyModel, Tag("body")]
    | Annotated[PointModel, Tag("point")]
    | Annotated[BlockModel, Tag("block")]
    | Annotated[CableModel, Tag("cable")],
    Discriminator(
        sort_of,
        custom_error_type="element",
        custom_error_message="an element needs exactly one of the keys " + ", ".join(SORTS),
    ),
]
BlockModel.model_rebuild()
