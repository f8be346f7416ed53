"""First natural frequency."""

from __future__ import annotations

from stiffmap.workspace.performance.motion.frequencies import natural_frequencies
from stiffmap.workspace.performance.registry import Case, Found, Measure, over_poses


def compute(case: Case) -> Found:
    """Over a coarse grid of the box, unloaded, drives held."""
    w = natural_frequencies(
        case.machine,
        case.coarse_positions,
        rotation=case.rotation,
        gravity=case.gravity,
        modes=1,
        threads=case.threads,
    )
    return over_poses(case.coarse_positions, w.frequency[:, 0], "high")


MEASURE = Measure("frequency", "first natural frequency", "Hz", "high", compute, "Hz", order=42)
