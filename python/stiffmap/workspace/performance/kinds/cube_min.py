"""Speed per drive speed that is reached in every direction: inscribed sphere of Figure 1b."""

from __future__ import annotations

from stiffmap.workspace.performance.registry import Case, Found, Measure, over_poses


def compute(case: Case) -> Found:
    """Over all poses of the box, each drive within one unit of speed."""
    v = case.factors
    return over_poses(case.positions, v.cube_min, "high", length=v.length)


MEASURE = Measure(
    "cube_min", "speed in every direction per drive speed (cube)", "", "high", compute, order=13
)
