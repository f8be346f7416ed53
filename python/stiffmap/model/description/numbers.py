"""Numbers of a joint and its drive: each is declared once, as a field of the dataclass that holds it.

The keys of machine files with their units and bounds, reading, saving, changing a number by its full name, its
uncertainty, the JSON schema and the core's data follow from the declaration.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from functools import cache
from typing import Any

from stiffmap.common.units import ANGLE, FORCE, LENGTH, MOMENT, Dimension


@dataclass(frozen=True)
class JointNumber:
    """One number, or an interval of two.

    key
        In a machine file, with a dot where it stands in a mapping of its own: ``friction.coulomb``.
    coordinate, effort
        Its unit as powers of the joint's coordinate (m, rad) and effort (N, N·m); times are in seconds.
    lower, upper
        Bounds in SI.
    passive
        Whether joints without a drive have it as well.
    core
        Name in the core's ``DriveNumbers``; empty: no calculation in the core uses it.
    """

    key: str
    doc: str
    coordinate: int = 0
    effort: int = 0
    lower: float = float("-inf")
    upper: float = float("inf")
    interval: bool = False
    passive: bool = False
    core: str = ""
    name: str = ""
    default: Any = None

    def dimension(self, angular: bool) -> Dimension:
        """Unit on a joint that turns, or that slides."""
        coordinate, effort = (ANGLE, MOMENT) if angular else (LENGTH, FORCE)
        pairs = zip(coordinate, effort, strict=True)
        return Dimension(*(self.coordinate * c + self.effort * e for c, e in pairs))


def number(key: str, doc: str, *, default: float | None = None, **more: Any) -> Any:
    """A field of a dataclass that is a number of a joint; `more` as in `JointNumber`."""
    return field(default=default, metadata={"number": JointNumber(key, doc, default=default, **more)})


def interval(key: str, doc: str, *, passive: bool = False) -> Any:
    """A field that is an interval of the joint's coordinate."""
    return field(default=None, metadata={"number": JointNumber(key, doc, 1, interval=True, passive=passive)})


def numbers_of(holder: Any) -> tuple[JointNumber, ...]:
    """The numbers that a dataclass, or one of its kind, declares, in its order."""
    return _numbers(holder if isinstance(holder, type) else type(holder))


@cache
def _numbers(holder: Any) -> tuple[JointNumber, ...]:
    return tuple(replace(f.metadata["number"], name=f.name) for f in fields(holder) if "number" in f.metadata)
