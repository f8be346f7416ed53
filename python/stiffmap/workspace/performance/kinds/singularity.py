"""How near the box comes to a singularity, and of which type."""

from __future__ import annotations

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.workspace.performance.motion.velocity import VelocityTransmission
from stiffmap.workspace.performance.registry import Case, Found, Measure, over_poses

TYPES = (
    "type 1: a drive stops moving the tool",
    "type 2: the tool runs away from its drives",
    "constraint: with the drives held, the machine moves as no drive moves it",
)
APART = 0.1
"""The loops lose rank at type 2 as well, but not that much faster than the tool runs away."""


def compute(case: Case) -> Found:
    """Over all poses of the box, the smallest of `distances`; the note says which one."""
    table = distances(case.factors, case.kinematics.pivot)
    nearest = table.min(axis=0)
    found = over_poses(case.positions, nearest, "high")
    if not np.isfinite(found.worst):
        return found
    which = TYPES[int(np.argmin(table[:, int(np.argmin(nearest))]))]
    return Found(**{**found.__dict__, "note": f"nearest is {which}"})


def distances(v: VelocityTransmission, pivot: Floats) -> Floats:
    """(3, ...) numbers from 0 (singular) to 1, one for each type.

    Type 1: smallest transmission factor. Type 2: one over the largest. Constraint: root of the relative pivot of
    the loops' normal matrix with the drives held, 1 unless it is far smaller than the number of type 2.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        one, two, loops = v.sphere_min, 1 / v.sphere_max, np.sqrt(pivot)
        third = np.where(loops < APART * two, loops, 1.0)
    return np.asarray(np.minimum(np.stack([one, two, third]), 1.0))


MEASURE = Measure("singularity", "distance from singularities (0: singular)", "", "high", compute, order=15)
