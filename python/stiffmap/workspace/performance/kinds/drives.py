"""What the tool does per speed and effort of the drives (§3, equations (1) and (2)): velocity transmission, singular values of the Jacobian
(Figure 1a) and the sphere inscribed in the image of the cube (Figure 1b); how near the box comes to a singularity, and of which type; speed,
force, acceleration and accuracy within what the machine file declares of its drives."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from stiffmap.workspace.maps.inputs import plane_axes
from stiffmap.workspace.performance.motion.closing import commanded_axes, commanded_jacobian, drive_values
from stiffmap.workspace.performance.motion.efforts import acceleration_of, held_forces
from stiffmap.workspace.performance.motion.many_drives import inner_radius, inverse_rows
from stiffmap.workspace.performance.motion.velocity import accuracy_of, distances
from stiffmap.workspace.performance.registry import Case, Found, Measure, over_poses

TYPES = (
    "type 1: a drive stops moving the tool",
    "type 2: the tool runs away from its drives",
    "constraint: with the drives held, the machine moves as no drive moves it",
)


def transmission(case: Case, factor: str, better: str) -> Found:
    """Over all poses of the box, one field of `VelocityTransmission`."""
    v = case.factors
    return over_poses(case.positions, getattr(v, factor), better, length=v.length)


def factor_measure(name: str, title: str, factor: str, better: str, order: int) -> Measure:
    """The measure of one field."""
    return Measure(name, title, "", better, partial(transmission, factor=factor, better=better), order=order)


def singularity(case: Case) -> Found:
    """Over all poses of the box, the smallest of `distances`; the note says which one."""
    table = distances(case.factors, case.kinematics.pivot)
    nearest = table.min(axis=0)
    found = over_poses(case.positions, nearest, "high")
    if not np.isfinite(found.worst):
        return found
    which = TYPES[int(np.argmin(table[:, int(np.argmin(nearest))]))]
    return replace(found, note=f"nearest is {which}")


def velocity(case: Case) -> Found:
    """Over all poses of the box, drives within the speeds that the machine file declares."""
    speeds = drive_values(case.machine, "speed", None, "m/s or rad/s")
    j, axes = commanded_jacobian(case.machine, case.kinematics), commanded_axes(case.machine, case.plane)
    rates = inverse_rows(j)[..., axes]
    return over_poses(case.positions, inner_radius(rates, speeds), "high")


def force(case: Case) -> Found:
    """Over all poses of the box, drives within the efforts that the machine file declares."""
    most = drive_values(case.machine, "force", None, "N or N·m")
    positions, k, note = case.positions, case.kinematics, ""
    if case.machine.compiled.names.cables:
        positions, k = case.coarse_positions, case.coarse_kinematics
        note = "cables: over the coarse grid, any tensions"
    rows, limits, offset = held_forces(case.machine, k, most, case.gravity)
    radii = inner_radius(rows[..., list(plane_axes(case.plane))], limits, offset)
    return over_poses(positions, radii, "high", note)


def acceleration(case: Case) -> Found:
    """Over a coarse grid of the box, drives within the efforts that the machine file declares."""
    reached = acceleration_of(case.machine, case.coarse_kinematics, gravity=case.gravity)
    return over_poses(case.coarse_positions, reached, "high")


def accuracy(case: Case) -> Found:
    """Over all poses of the box, encoders within the errors that the machine file declares."""
    a = accuracy_of(case.machine, case.kinematics, plane=case.plane)
    return over_poses(case.positions, a.plane, "low")


MEASURES = (
    factor_measure("transmission_min", "smallest velocity transmission factor", "sphere_min", "high", 10),
    factor_measure("transmission_max", "largest velocity transmission factor", "sphere_max", "low", 11),
    factor_measure("condition", "condition number of the Jacobian", "condition", "low", 12),
    factor_measure("cube_min", "speed in every direction per drive speed (cube)", "cube_min", "high", 13),
    Measure("singularity", "distance from singularities (0: singular)", "", "high", singularity, order=15),
    Measure("velocity", "speed in every direction of the plane", "m/s", "high", velocity, "m/min", 60.0, order=20),
    Measure("force", "force held in every direction of the plane", "N", "high", force, "N", order=21),
    Measure("acceleration", "acceleration in every direction", "m/s^2", "high", acceleration, "m/s²", order=41),
    Measure("accuracy", "tool error in the plane from encoders", "m", "low", accuracy, "mm", 1e3, order=22),
)  # fmt: skip
