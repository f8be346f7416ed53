"""Deflection of the loaded machine in a plane, force in its worst direction there."""

from __future__ import annotations

import numpy as np

from stiffmap.performance.deflection import TURNS, worst_deflection
from stiffmap.performance.registry import Case, Found, Measure, over_poses


def compute(case: Case) -> Found:
    """Over the box: a coarse grid of equilibria, then a search about its worst node."""
    d = worst_deflection(
        case.machine, box=np.stack([case.low, case.high]), force=case.force, plane=case.plane,
        nodes=case.coarse, refine=not case.quick, turns=0 if case.quick else TURNS, rotation=case.rotation, gravity=case.gravity, threads=case.threads,
    )  # fmt: skip
    found = over_poses(d.positions, d.values, "low", f"under {case.force:.4g} N", direction=d.direction)
    return Found(**{**found.__dict__, "worst": d.value, "worst_at": d.position})


MEASURE = Measure("deflection", "deflection in the plane", "m", "low", compute, "mm", 1e3, order=30)
