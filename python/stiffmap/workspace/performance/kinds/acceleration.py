"""Acceleration of the tool that the drives reach from rest in every direction."""

from __future__ import annotations

from stiffmap.workspace.performance.motion.efforts import acceleration_of
from stiffmap.workspace.performance.motion.inertia import need_masses
from stiffmap.workspace.performance.registry import Case, Found, Measure, over_poses


def compute(case: Case) -> Found:
    """Over a coarse grid of the box, drives within the efforts that the machine file declares."""
    need_masses(case.machine, "acceleration")
    a = acceleration_of(case.machine, case.coarse_kinematics, gravity=case.gravity)
    return over_poses(case.coarse_positions, a.smallest, "high")


MEASURE = Measure(
    "acceleration", "acceleration in every direction", "m/s^2", "high", compute, "m/s²", order=41
)
