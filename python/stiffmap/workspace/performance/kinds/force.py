"""Force on the tool that the drives hold in every direction of a plane, at rest."""

from __future__ import annotations

import numpy as np

from stiffmap.workspace.maps.inputs import plane_axes
from stiffmap.workspace.performance.motion.inertia import rest_efforts
from stiffmap.workspace.performance.motion.polygons import inner_radius
from stiffmap.workspace.performance.motion.scaling import drive_values
from stiffmap.workspace.performance.motion.tensions import held, in_cables, pushes
from stiffmap.workspace.performance.registry import Case, Found, Measure, over_poses


def compute(case: Case) -> Found:
    """Over all poses of the box, drives within the efforts that the machine file declares."""
    most = drive_values(case.machine, "force", None, "N or N·m")
    if (h := in_cables(case.machine, "the force that is held")) is not None:
        rows, limits, offset = held(case.machine, h, case.coarse_kinematics, pushes(h), most, case.gravity)
        radii = inner_radius(rows[..., list(plane_axes(case.plane))], limits, offset)
        return over_poses(
            case.coarse_positions, radii, "high", note="cables: over the coarse grid, any tensions"
        )
    bias = rest_efforts(case.machine, case.kinematics, gravity=case.gravity, velocity=None)
    needed = -np.swapaxes(case.kinematics.jacobian[..., list(plane_axes(case.plane)), :], -1, -2)
    return over_poses(case.positions, inner_radius(needed, most, bias), "high")


MEASURE = Measure("force", "force held in every direction of the plane", "N", "high", compute, "N", order=21)
