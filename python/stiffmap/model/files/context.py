"""Where the builder is in the file and in the machine, and what it gathers besides elements."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NoReturn, TypeVar

from stiffmap.common.errors import FileError, together
from stiffmap.common.number_text import LARGEST, SMALLEST
from stiffmap.common.units import Dimension, UnitSystem
from stiffmap.common.yaml_text import Document, KeyPath
from stiffmap.model.files.report import key_text
from stiffmap.model.files.schema.base import Noted, Number
from stiffmap.model.files.schema.elements import SpringModel
from stiffmap.model.files.schema.springs import MaterialModel

T = TypeVar("T")


@dataclass
class LinkUse:
    """A link file: (21, 21) covariance of the upper entries k11, k12 … k66 (SI), and the springs it gives."""

    covariance: tuple[tuple[float, ...], ...]
    springs: list[str] = field(default_factory=list)


@dataclass
class Gathered:
    """What belongs to the whole machine, in the order of the file, keyed ``full.name/field``."""

    uncertainty: dict[str, float] = field(default_factory=dict)
    notes: dict[str, str] = field(default_factory=dict)
    sources: dict[str, str] = field(default_factory=dict)
    links: dict[str, LinkUse] = field(default_factory=dict)
    strokes: list[tuple[SpringModel, Context]] = field(default_factory=list)
    """Springs with a stroke, which are built when all joints are known."""
    problems: list[FileError] = field(default_factory=list)


@dataclass(frozen=True)
class Context:
    """Units and materials of the file; ``path`` in it; ``full`` name in the machine."""

    file: str
    document: Document
    folder: Path
    units: UnitSystem
    materials: dict[str, MaterialModel]
    gathered: Gathered
    path: KeyPath = ()
    full: str = ""

    def at(self, *keys: str | int) -> Context:
        """The same place in the machine, deeper in the file."""
        return replace(self, path=self.path + keys)

    def inside(self, name: str) -> Context:
        """An element or sequence of the machine."""
        return replace(self, full=f"{self.full}.{name}" if self.full else name)

    def error(self, message: str) -> FileError:
        """An error at this place."""
        line = self.document.line(self.path)
        return FileError(message, file=self.file, line=line, key=key_text(self.path))

    def fail(self, message: str) -> NoReturn:
        """Raise an error at this place."""
        raise self.error(message)

    def attempt(self, build: Callable[..., T], *given: object) -> T | None:
        """What ``build`` makes of what is given; None where it fails, its problem kept for the end."""
        try:
            return build(*given)
        except FileError as problem:
            self.gathered.problems.append(problem)
            return None

    def raise_problems(self) -> None:
        """Raise everything that was kept."""
        if self.gathered.problems:
            raise together(self.gathered.problems)

    def named(self, name: str, said: Noted) -> Context:
        """An element or sequence of the machine, with what the file says of its numbers kept."""
        inside = self.inside(name)
        inside.keep(said)
        return inside

    def keep(self, said: Noted | Number, field_name: str = "") -> None:
        """Keep the note about the element, or one of its numbers, and where it comes from."""
        key = f"{self.full}/{field_name}" if field_name else self.full
        if said.note:
            self.gathered.notes[key] = said.note
        if said.source:
            self.gathered.sources[key] = said.source

    def si(self, number: Number, dimension: Dimension, field_name: str = "") -> float:
        """SI value; its uncertainty and note are kept under ``field_name`` of the element."""
        self._keep(number, dimension, field_name)
        return self._converted(number.value, dimension)

    def inverse(self, number: Number, dimension: Dimension, field_name: str) -> float:
        """SI value of 1/number (a stiffness from a compliance); the uncertainty follows to first order."""
        value = self._converted(number.value, dimension)
        if value <= 0.0 or math.isinf(1.0 / value):
            self.fail(f"a compliance must be positive (use rigid: true for none); found {number.value}")
        self._keep(number, dimension, field_name, value**2)
        return 1.0 / value

    def _keep(self, number: Number, dimension: Dimension, field_name: str, over: float = 1.0) -> None:
        """What a file says of a number of the element; its uncertainty divided by ``over``."""
        if not field_name:
            return
        self.keep(number, field_name)
        if number.u is not None:
            self.gathered.uncertainty[f"{self.full}/{field_name}"] = (
                self._converted(number.u, dimension) / over
            )

    def _converted(self, value: float, dimension: Dimension) -> float:
        try:
            si = self.units.to_si(value, dimension)
        except OverflowError:
            si = math.inf
        if not (si == 0.0 or SMALLEST <= abs(si) <= LARGEST):
            size = "large" if abs(si) > LARGEST else "small"
            self.fail(
                f"the number is too {size}: {value} (no machine has it; squares and products must be finite)"
            )
        return si
