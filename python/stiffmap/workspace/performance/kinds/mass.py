"""Mass that the drives move."""

from __future__ import annotations

from stiffmap.workspace.performance.motion.inertia import moving_mass, need_masses, total_mass
from stiffmap.workspace.performance.registry import Case, Found, Measure


def compute(case: Case) -> Found:
    """All bodies that joints move."""
    need_masses(case.machine, "mass")
    return Found(moving_mass(case.machine), note=f"all bodies: {total_mass(case.machine):.4g} kg")


MEASURE = Measure("mass", "moving mass", "kg", "low", compute, "kg", order=40)
