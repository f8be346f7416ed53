"""Force transmission, equation (2) of the paper: what the drives can hold at the tool (docs/measures.md)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.common.short import short_repr
from stiffmap.solve.machine import Machine, takes_machine
from stiffmap.solve.results import OverPoses
from stiffmap.workspace.maps.inputs import plane_axes
from stiffmap.workspace.performance.motion.closing import DriveKinematics, drive_kinematics
from stiffmap.workspace.performance.motion.inertia import rest_efforts
from stiffmap.workspace.performance.motion.scaling import characteristic_length, drive_limits, weighted
from stiffmap.workspace.performance.motion.tensions import as_tensions, held, in_cables, pushes, radius
from stiffmap.workspace.performance.motion.velocity import of_motions, singular_values
from stiffmap.workspace.performance.motion.zonotopes import Polygon, section_polygon


@short_repr
@dataclass(frozen=True, eq=False)
class ForceTransmission(OverPoses):
    """Holdable forces at the TCP at poses (...); NaN where the pose failed."""

    sphere_min: Floats
    """(...) smallest singular value of J^-T, weighted as the velocity's: force per unit norm of efforts."""
    sphere_max: Floats
    """(...) largest."""
    force_min: Floats
    """(...) N, force that the drives hold in every direction of space, no moment. Cables: by any tensions from 0 to the limits."""
    plane: Polygon
    """Forces that the drives hold in the plane: N, or per unit effort."""
    bias: Floats
    """(..., drives) N or N·m, effort that each drive needs without a force on the tool; NaN where cables do not hold it."""
    limits: Floats
    """(drives,) effort limit of each drive."""
    status: NDArray[np.uint8]


@takes_machine
def force_transmission(
    machine: Machine,
    position: ArrayLike,
    rotation: ArrayLike | None = None,
    *,
    plane: str = "xy",
    limits: ArrayLike | str = "declared",
    gravity: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    length: float | None = None,
    sharing: str = "least_norm",
    threads: int | None = None,
) -> ForceTransmission:
    """Smallest and largest force that the drives hold, at rest or at speed, at poses (..., 3) m.

    A force f on the tool requires the drive efforts -J^T f (virtual work; the paper's (2) has the force that
    the machine exerts). Limits: ``declared`` in the machine file, ``unit``, or numbers (N, N·m).

    gravity
        (3,) m/s²; None: what the machine file says. Its efforts count against the limits.
    velocity
        (..., 3) m/s of the TCP, no acceleration, no rotation: inertia and friction at that speed count
        against the limits too; None: at rest, without friction.
    sharing
        Of drives that outnumber the freedoms: ``least_norm`` or ``stiffness`` (docs/measures.md).

    Raises StiffmapError for bad input, never for a pose.
    """
    k = drive_kinematics(machine, position, rotation, sharing=sharing, threads=threads)
    most = drive_limits(machine, "force", limits, "N or N·m")
    if (h := in_cables(machine, "the force that is held")) is None:
        bias = rest_efforts(machine, k, gravity=gravity, velocity=velocity, sharing=sharing)
        found = -np.swapaxes(k.jacobian[..., :3, :], -1, -2), most, bias  # effort per force on the tool
    else:
        if velocity is not None:
            raise StiffmapError(f"{machine.name}: velocity: for cables the force is known at rest alone")
        found = held(machine, h, k, pushes(h), most, gravity)
        still = rest_efforts(machine, k, gravity=gravity, velocity=None)
        bias = as_tensions(machine, h, k, still, most, sharing)
    rows, room, offset = found
    least, largest = _spheres(machine, k, length)
    return ForceTransmission(
        sphere_min=least,
        sphere_max=largest,
        force_min=radius(found),
        plane=section_polygon(rows[..., list(plane_axes(plane))], room, k.status, offset),
        bias=bias,
        limits=most,
        status=k.status,
    )


def _spheres(machine: Machine, k: DriveKinematics, length: float | None) -> tuple[Floats, Floats]:
    """(...) smallest and largest singular values of the efforts' transmission."""
    with np.errstate(divide="ignore", invalid="ignore"):
        j = weighted(machine, k.jacobian, characteristic_length(machine, length), "all")
        s, last = of_motions(machine, k, singular_values(j))
        return 1 / s[..., 0], 1 / last
