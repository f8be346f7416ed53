"""Warnings at points of a job: each has a name, the points that it is about, and one sentence.

A further kind of warning is a function of a `Milled` in SOURCES.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from stiffmap.milling.limits import outside

if TYPE_CHECKING:
    from stiffmap.milling.job import Milled


@dataclass(frozen=True, eq=False)
class Warned:
    """One warning."""

    name: str
    """Few words, as ``drive speed``."""
    points: NDArray[np.bool_]
    """(m,)."""
    text: str
    """A sentence for the report."""
    finding: bool = True
    """Whether the command ends with exit code 1."""


def limits(found: Milled) -> list[Warned]:
    """Ranges, efforts and speeds of the drives; the box of the machine file is only mentioned."""
    out = []
    for name, points in outside(found.dataset, found.job.machine).items():
        text = f"The {name} is broken at {int(points.sum())} of {points.size} points."
        if name == "declared workspace":
            text = f"{int(points.sum())} of {points.size} points are outside the workspace that the machine file declares."
        out.append(Warned(name, points, text, finding=name != "declared workspace"))
    return out


SOURCES: tuple[Callable[[Milled], list[Warned]], ...] = (limits,)


def warned(found: Milled) -> list[Warned]:
    """All warnings that are about at least one point."""
    return [w for source in SOURCES for w in source(found) if w.points.any()]


def mark(found: Milled) -> None:
    """Put them into the dataset: `warnings` (m,), one bit for each name in its attribute `names`."""
    bits = np.zeros(len(found.job), np.uint32)
    for k, w in enumerate(found.warnings):
        bits |= np.where(w.points, np.uint32(1 << k), np.uint32(0))
    found.dataset["warnings"] = ("point", bits)
    found.dataset["warnings"].attrs["names"] = [w.name for w in found.warnings]
