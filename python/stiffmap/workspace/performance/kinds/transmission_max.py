"""Largest velocity transmission factor (singular value of the Jacobian), Figure 1a."""

from __future__ import annotations

from stiffmap.workspace.performance.registry import Case, Found, Measure, over_poses


def compute(case: Case) -> Found:
    """Over all poses of the box."""
    v = case.factors
    return over_poses(case.positions, v.sphere_max, "low", length=v.length)


MEASURE = Measure("transmission_max", "largest velocity transmission factor", "", "low", compute, order=11)
