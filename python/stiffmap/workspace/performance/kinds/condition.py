"""Condition number of the Jacobian."""

from __future__ import annotations

from stiffmap.workspace.performance.registry import Case, Found, Measure, over_poses


def compute(case: Case) -> Found:
    """Over all poses of the box."""
    v = case.factors
    return over_poses(case.positions, v.condition, "low", length=v.length)


MEASURE = Measure("condition", "condition number of the Jacobian", "", "low", compute, order=12)
