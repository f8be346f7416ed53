"""Velocity transmission: singular values of the Jacobian (Figure 1a), and the sphere inscribed in the image of the cube (Figure 1b); how
near the box comes to a singularity, and of which type."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from stiffmap.workspace.performance.motion.velocity import distances
from stiffmap.workspace.performance.registry import Case, Found, Measure, over_poses

TYPES = (
    "type 1: a drive stops moving the tool",
    "type 2: the tool runs away from its drives",
    "constraint: with the drives held, the machine moves as no drive moves it",
)


def compute(case: Case, factor: str, better: str) -> Found:
    """Over all poses of the box, one field of `VelocityTransmission`."""
    v = case.factors
    return over_poses(case.positions, getattr(v, factor), better, length=v.length)


def measure(name: str, title: str, factor: str, better: str, order: int) -> Measure:
    """The measure of one field."""
    return Measure(name, title, "", better, partial(compute, factor=factor, better=better), order=order)


def singularity(case: Case) -> Found:
    """Over all poses of the box, the smallest of `distances`; the note says which one."""
    table = distances(case.factors, case.kinematics.pivot)
    nearest = table.min(axis=0)
    found = over_poses(case.positions, nearest, "high")
    if not np.isfinite(found.worst):
        return found
    which = TYPES[int(np.argmin(table[:, int(np.argmin(nearest))]))]
    return replace(found, note=f"nearest is {which}")


MEASURES = (
    measure("transmission_min", "smallest velocity transmission factor", "sphere_min", "high", 10),
    measure("transmission_max", "largest velocity transmission factor", "sphere_max", "low", 11),
    measure("condition", "condition number of the Jacobian", "condition", "low", 12),
    measure("cube_min", "speed in every direction per drive speed (cube)", "cube_min", "high", 13),
    Measure("singularity", "distance from singularities (0: singular)", "", "high", singularity, order=15),
)
