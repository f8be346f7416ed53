"""What the tool does within what the machine file declares of its drives: speed, force, acceleration, accuracy."""

from __future__ import annotations

import numpy as np

from stiffmap.workspace.maps.inputs import plane_axes
from stiffmap.workspace.performance.motion.closing import drive_values
from stiffmap.workspace.performance.motion.efforts import acceleration_of
from stiffmap.workspace.performance.motion.force import accuracy_of
from stiffmap.workspace.performance.motion.inertia import rest_efforts
from stiffmap.workspace.performance.motion.tensions import PUSHES, held, in_cables
from stiffmap.workspace.performance.motion.zonotopes import inner_radius
from stiffmap.workspace.performance.registry import Case, Found, Measure, over_poses


def velocity(case: Case) -> Found:
    """Over all poses of the box, drives within the speeds that the machine file declares."""
    speeds = drive_values(case.machine, "speed", None, "m/s or rad/s")
    rates = case.inverse[..., list(plane_axes(case.plane))]
    return over_poses(case.positions, inner_radius(rates, speeds), "high")


def force(case: Case) -> Found:
    """Over all poses of the box, drives within the efforts that the machine file declares."""
    most = drive_values(case.machine, "force", None, "N or N·m")
    if (h := in_cables(case.machine, "the force that is held")) is not None:
        rows, limits, offset = held(case.machine, h, case.coarse_kinematics, PUSHES, most, case.gravity)
        radii = inner_radius(rows[..., list(plane_axes(case.plane))], limits, offset)
        return over_poses(
            case.coarse_positions, radii, "high", note="cables: over the coarse grid, any tensions"
        )
    bias = rest_efforts(case.machine, case.kinematics, gravity=case.gravity, velocity=None)
    needed = -np.swapaxes(case.kinematics.jacobian[..., list(plane_axes(case.plane)), :], -1, -2)
    return over_poses(case.positions, inner_radius(needed, most, bias), "high")


def acceleration(case: Case) -> Found:
    """Over a coarse grid of the box, drives within the efforts that the machine file declares."""
    reached = acceleration_of(case.machine, case.coarse_kinematics, gravity=case.gravity)
    return over_poses(case.coarse_positions, reached, "high")


def accuracy(case: Case) -> Found:
    """Over all poses of the box, encoders within the errors that the machine file declares."""
    a = accuracy_of(case.machine, case.kinematics, plane=case.plane)
    return over_poses(case.positions, a.plane, "low")


MEASURES = (
    Measure(
        "velocity", "speed in every direction of the plane", "m/s", "high", velocity, "m/min", 60.0, order=20
    ),
    Measure("force", "force held in every direction of the plane", "N", "high", force, "N", order=21),
    Measure(
        "acceleration", "acceleration in every direction", "m/s^2", "high", acceleration, "m/s²", order=41
    ),
    Measure("accuracy", "tool error in the plane from encoders", "m", "low", accuracy, "mm", 1e3, order=22),
)
