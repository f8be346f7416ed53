"""Tool error in a plane that encoder errors make, equation (1)."""

from __future__ import annotations

from stiffmap.workspace.performance.motion.accuracy import accuracy_of
from stiffmap.workspace.performance.registry import Case, Found, Measure, over_poses


def compute(case: Case) -> Found:
    """Over all poses of the box, encoders within the errors that the machine file declares."""
    a = accuracy_of(case.machine, case.kinematics, plane=case.plane)
    return over_poses(case.positions, a.plane, "low")


MEASURE = Measure(
    "accuracy", "tool error in the plane from encoders", "m", "low", compute, "mm", 1e3, order=22
)
