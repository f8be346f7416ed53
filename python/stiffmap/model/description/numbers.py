"""Numbers of an element: each is declared once, as a field of the dataclass that holds it.

The keys of machine files with their units and bounds, reading, saving, changing a number by its full name, its
uncertainty, the JSON schema and the core's data follow from the declaration.
"""

from __future__ import annotations

from dataclasses import MISSING, dataclass, field, fields, replace
from functools import cache
from typing import Any

from stiffmap.common.units import ANGLE, FORCE, LENGTH, MOMENT, NONE, Dimension

DIRECTIONS = ("tx", "ty", "tz", "rx", "ry", "rz")
PARTS = {"interval": ("low", "high"), "vector": ("x", "y", "z"), "directions": DIRECTIONS}


@dataclass(frozen=True)
class DeclaredNumber:
    """One number, or several under one key.

    key
        In a machine file, with a dot where it stands in a mapping of its own: ``friction.coulomb``.
    coordinate, effort, time, fixed
        Its unit as powers of the joint's coordinate (m, rad), of its effort (N, N·m) and of the second, times a unit
        that is the same on every joint.
    lower, upper
        Bounds in SI.
    shape
        Empty for one number; an ``interval`` of two, a ``vector``, one for each of six ``directions``, or for each of
        the joint's ``axes`` (whose keys in a file the schema has); ``knots`` are pairs of a coordinate and such a number.
    passive
        Whether joints without a drive have it as well.
    core
        Name in the core's ``DriveNumbers``; empty: no calculation in the core uses it.
    saved
        Whether a file has it also where it is as by default.
    needed
        Whether every file must give it; the schema's class then has the key.
    address
        Whether it has an address.
    """

    key: str
    doc: str = ""
    coordinate: int = 0
    effort: int = 0
    time: int = 0
    fixed: Dimension = NONE
    lower: float = float("-inf")
    upper: float = float("inf")
    shape: str = ""
    passive: bool = False
    core: str = ""
    saved: bool = False
    needed: bool = False
    address: bool = True
    name: str = ""
    default: Any = None

    @property
    def expected(self) -> str:
        """Its bounds in words."""
        above = "a number that is not negative" if self.lower == 0.0 else f"{self.lower:g} or more (SI)"
        return above if self.upper == float("inf") else f"{self.lower:g} to {self.upper:g} (SI)"

    def dimension(self, angular: bool = False) -> Dimension:
        """Unit on a joint that turns, or that slides."""
        coordinate, effort = (ANGLE, MOMENT) if angular else (LENGTH, FORCE)
        powers = zip(coordinate, effort, self.fixed, strict=True)
        return Dimension(*(self.coordinate * c + self.effort * e + f for c, e, f in powers))

    def keys(self, value: Any) -> list[str]:
        """The key of each part of a value."""
        if not self.shape or (self.shape == "axes" and len(value) == 1):
            return [self.key]
        return [f"{self.key}.{part}" for part in PARTS.get(self.shape, range(1, len(value) + 1))]

    def turns(self, part: int, angular: bool) -> bool:
        """Whether a part is of a coordinate that turns."""
        return part > 2 if self.shape == "directions" else angular


def number(key: str, doc: str = "", *, default: Any = None, **more: Any) -> Any:
    """A field of a dataclass that is a number; `more` as in `DeclaredNumber`."""
    return field(default=default, metadata={"number": DeclaredNumber(key, doc, default=default, **more)})


def required(key: str, **more: Any) -> Any:
    """A field without a default value."""
    return number(key, default=MISSING, **more)


def interval(key: str, doc: str, *, passive: bool = False) -> Any:
    """A field that is an interval of the joint's coordinate."""
    return number(key, doc, coordinate=1, shape="interval", passive=passive)


def numbers_of(holder: Any) -> tuple[DeclaredNumber, ...]:
    """The numbers that a dataclass, or one of its kind, declares, in its order."""
    return _numbers(holder if isinstance(holder, type) else type(holder))


@cache
def _numbers(holder: Any) -> tuple[DeclaredNumber, ...]:
    return tuple(replace(f.metadata["number"], name=f.name) for f in fields(holder) if "number" in f.metadata)


def with_entry(holder: Any, name: str, i: int, value: Any) -> Any:
    """The holder of several values, in a field of this name, with another one of them."""
    old = getattr(holder, name)
    return replace(holder, **{name: (*old[:i], value, *old[i + 1 :])})


def with_part(holder: Any, n: DeclaredNumber, part: int, value: float) -> Any:
    """The holder of a number with another value in one of its parts."""
    return with_entry(holder, n.name, part, value) if n.shape else replace(holder, **{n.name: value})
