"""What a task asks of a machine: ``trimming.yaml`` (docs/measures.md)."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Literal

from pydantic import Field

from stiffmap.common.broadcasting import given_path
from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.common.short import short_repr
from stiffmap.common.yaml_text import Document, read
from stiffmap.model.files.report import validated
from stiffmap.model.files.schema.base import FileModel, Name
from stiffmap.workspace.performance.motion.motion_files import given_or_shipped, near_or_shipped
from stiffmap.workspace.performance.quantities import Edge, PositiveForce, PositiveLength, quantity, under
from stiffmap.workspace.performance.registry import get_measure

Written = str | float | int


class RequiredBoxModel(FileModel):
    """Edges of the box in which the machine works, with units; a machine that moves in a plane has a box without thickness."""

    x: PositiveLength
    y: Edge
    z: Edge


class BoundModel(FileModel):
    """One or both bounds of a measure, with units."""

    at_least: Written | None = None
    at_most: Written | None = None


class LimitsModel(FileModel):
    """What poses of the workspace and of the largest box keep, with units."""

    clearance: PositiveLength | None = None
    deflection: PositiveLength | None = None


class RequirementsFile(FileModel):
    """The keys of a requirements file."""

    name: Name
    title: str = ""
    source: str = ""
    box: RequiredBoxModel | None = None
    plane: Literal["xy", "xz", "yz"] = "xy"
    force: PositiveForce | None = None
    toolpath: str | None = None
    limits: LimitsModel = LimitsModel()
    requirements: dict[str, BoundModel] = Field(default_factory=dict)


@dataclass(frozen=True)
class Bound:
    """A requirement on one measure, SI."""

    at_least: float | None = None
    at_most: float | None = None

    def margin(self, value: float) -> float:
        """How far inside the value is (negative: outside), in its own unit."""
        sides = ((self.at_least, value), (value, self.at_most))
        return min(high - low for low, high in sides if low is not None and high is not None)

    def text(self, factor: float) -> str:
        """``≥ 500`` and the like, in the unit of which SI's has so many."""
        sides = (("≥", self.at_least), ("≤", self.at_most))
        return " ".join(f"{sign} {factor * v:.4g}" for sign, v in sides if v is not None)


@short_repr
@dataclass(frozen=True)
class Requirements:
    """A task: the box, the force on the tool and the bounds, SI."""

    name: str = "none"
    title: str = ""
    source: str = ""
    box: tuple[float, float, float] | None = None
    plane: str = "xy"
    force: float | None = None
    bounds: tuple[tuple[str, Bound], ...] = ()
    toolpath: str | None = None
    """Motion file of the task."""
    clearance: float | None = None
    """m, least distance between members of different legs in the workspace."""
    deflection: float | None = None
    """m, largest deflection under the force in the workspace."""

    def bound(self, measure: str) -> Bound | None:
        """The bound on a measure, if there is one."""
        return dict(self.bounds).get(measure)

    @property
    def transmission(self) -> tuple[float, float]:
        """Range of the transmission factors within which a pose counts; the paper's where the task names none."""
        least, most = (self.bound(f"transmission_{end}") or Bound() for end in ("min", "max"))
        return (
            0.5 if least.at_least is None else least.at_least,
            2.0 if most.at_most is None else most.at_most,
        )

    @property
    def proportions(self) -> tuple[float, float, float]:
        """Edges of the task's box relative to the first; a cube where there is no box."""
        x, y, z = self.box or (1.0, 1.0, 1.0)
        return 1.0, y / x, z / x


def bound_in(document: Document, file: str, given: BoundModel, *keys: str) -> Bound:
    """The bound of the measure that is the last of the keys under which it stands.

    FileError for a measure that does not exist and for bounds that are no interval.
    """
    sides = (("at_least", given.at_least), ("at_most", given.at_most))
    with under(document, file, *keys):
        unit = get_measure(keys[-1]).unit
        ends: list[float | None] = []
        for side, value in sides:
            with under(document, file, *keys, side):
                ends.append(None if value is None else quantity(value, unit))
        least, most = ends
        if least is None and most is None:
            raise StiffmapError("give at_least or at_most")
        if least is not None and most is not None and least > most:
            raise StiffmapError(f"at_least ({given.at_least}) is above at_most ({given.at_most})")
    return Bound(least, most)


def load_requirements(source: str | PathLike[str]) -> Requirements:
    """Requirements from a file, or the shipped ones by name (``trimming``).

    Raises FileError naming file, line, key, what was expected and what was found.
    """
    path = given_path(source, "source", "a file or a shipped name")
    folder = Path(__file__).parent
    path = given_or_shipped(path, folder)
    if not path.is_file():
        known = ", ".join(sorted(p.stem for p in folder.glob("*.yaml")))
        raise FileError(
            f"no such requirements file, and none of that name is shipped (these are: {known})",
            file=str(path),
        )
    document, file = read(path), str(path)
    expected = "a requirements file is a mapping with name, box, force and requirements"
    model = validated(RequirementsFile, document, file, expected)
    bounds = tuple(
        (name, bound_in(document, file, given, "requirements", name))
        for name, given in model.requirements.items()
    )
    box = None if model.box is None else (model.box.x, model.box.y, model.box.z)
    toolpath = None if model.toolpath is None else near_or_shipped(model.toolpath, path.parent)
    return Requirements(
        model.name, model.title, model.source, box, model.plane, model.force, bounds, toolpath,
        model.limits.clearance, model.limits.deflection,
    )  # fmt: skip
