"""The sidecar of a URDF: loops and motors as example-parallel-robots (Gepetto) writes them, elasticity."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import ConfigDict, Discriminator, Field, Tag

from stiffmap.common.errors import FileError
from stiffmap.common.yaml_text import read
from stiffmap.model.files.report import validated
from stiffmap.model.files.schema.base import FileModel
from stiffmap.model.files.schema.machine import Components

Numbers6 = Annotated[list[float], Field(min_length=6, max_length=6)]
Matrix = Annotated[list[Numbers6], Field(min_length=6, max_length=6)]


def _form(terms: object) -> str:
    return "rows" if isinstance(terms, list) and any(isinstance(row, list) for row in terms) else "diagonal"


Terms = Annotated[Annotated[Numbers6, Tag("diagonal")] | Annotated[Matrix, Tag("rows")], Discriminator(_form)]


class Strict(FileModel):
    """Finite numbers."""

    model_config = ConfigDict(allow_inf_nan=False)


class Elasticity(Strict):
    """Of a drive (N/m or N·m/rad, or its inverse), or `rigid`."""

    stiffness: Annotated[float, Field(gt=0)] | None = None
    compliance: Annotated[float, Field(gt=0)] | None = None


class LinkSpring(Strict):
    """Six diagonal terms or six rows (SI), translations first, at the link's end in the axes there."""

    stiffness: Terms | None = None
    compliance: Terms | None = None


class Sidecar(Strict):
    """What a URDF lacks (SI)."""

    closed_loop: list[Annotated[list[str], Field(min_length=2, max_length=2)]] = Field(default_factory=list)
    type: list[Literal["3d", "6d", "3D", "6D"]] = Field(default_factory=list)
    name_mot: list[str] = Field(default_factory=list)
    joint_name: list[str] = Field(default_factory=list)
    joint_type: list[str] = Field(default_factory=list)
    tip: str | None = None
    home: dict[str, float] = Field(default_factory=dict)
    actuators: dict[str, Elasticity] = Field(default_factory=dict)
    springs: dict[str, LinkSpring] = Field(default_factory=dict)
    task: Components | None = None
    workspace: (
        dict[Literal["x", "y", "z"], Annotated[list[float], Field(min_length=2, max_length=2)]] | None
    ) = None


def read_sidecar(path: Path | None) -> Sidecar:
    """Checked sidecar; an empty one for None. FileError, one line."""
    if path is None:
        return Sidecar()
    file = str(path)
    side = validated(
        Sidecar, read(path), file, "a sidecar is a mapping with keys such as actuators, springs and home"
    )
    for a, b in (("closed_loop", "type"), ("joint_name", "joint_type")):
        if len(getattr(side, a)) != len(getattr(side, b)):
            raise FileError(f"expected one entry per entry of {a} ({len(getattr(side, a))}), "
                            f"found {len(getattr(side, b))}", file=file, key=b)  # fmt: skip
    elastic: dict[str, Elasticity | LinkSpring] = {**side.actuators, **side.springs}
    for name, given in elastic.items():
        if (given.stiffness is None) == (given.compliance is None):
            raise FileError("give exactly one of stiffness and compliance", file=file, key=name)
    for name in side.joint_type:
        if name.upper() != "SPHERICAL":
            raise FileError(f"expected SPHERICAL, found '{name}'", file=file, key="joint_type")
    return side
