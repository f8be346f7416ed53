"""Smallest velocity transmission factor (singular value of the Jacobian), Figure 1a."""

from __future__ import annotations

from stiffmap.workspace.performance.registry import Case, Found, Measure, over_poses


def compute(case: Case) -> Found:
    """Over all poses of the box."""
    v = case.factors
    return over_poses(case.positions, v.sphere_min, "high", length=v.length)


MEASURE = Measure("transmission_min", "smallest velocity transmission factor", "", "high", compute, order=10)
