"""Accuracy and force transmission, equations (1) and (2) of the paper: encoder errors to tool error, and what the drives can
hold at the tool (docs/measures.md)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.common.short import short_repr
from stiffmap.solve.kinematics import forward_kinematics
from stiffmap.solve.labels import OverPoses
from stiffmap.solve.machine import Machine, takes_machine
from stiffmap.workspace.maps.inputs import plane_axes
from stiffmap.workspace.performance.motion.closing import (
    DriveKinematics,
    characteristic_length,
    drive_kinematics,
    drive_limits,
    drive_values,
    weighted,
)
from stiffmap.workspace.performance.motion.inertia import PUSHES, as_tensions, held, in_cables, rest_efforts
from stiffmap.workspace.performance.motion.many_drives import (
    Polygon,
    corners,
    farthest_vertex,
    inner_radius,
    section_polygon,
    worst_corner,
)
from stiffmap.workspace.performance.motion.velocity import of_motions, singular_values


@short_repr
@dataclass(frozen=True, eq=False)
class AccuracyTransmission(OverPoses):
    """Largest tool error over the box of encoder errors, at poses (...); NaN where the pose failed."""

    translation: Floats
    """(...) m, largest distance of the TCP from its command, first order, exact over the box."""
    rotation: Floats
    """(...) rad, largest rotation of the platform."""
    plane: Floats
    """(...) m, largest distance in the plane asked for."""
    components: Floats
    """(..., 6) m, rad: largest error of each component of the twist."""
    corner: Floats
    """(..., drives) signs of the encoder errors with the largest translation."""
    nonlinear: Floats | None
    """(...) m, the largest translation over all corners by forward kinematics; None: not asked for."""
    errors: Floats
    """(drives,) m or rad, half-width of each encoder's error."""
    status: NDArray[np.uint8]


@takes_machine
def accuracy_transmission(
    machine: Machine,
    position: ArrayLike,
    rotation: ArrayLike | None = None,
    *,
    errors: ArrayLike | None = None,
    plane: str = "xy",
    nonlinear: bool = False,
    sharing: str = "least_norm",
    threads: int | None = None,
) -> AccuracyTransmission:
    """Worst tool error when every encoder may be wrong by up to ± its error, at poses (..., 3) m.

    The norm being convex, its largest value over the box of errors lies at a corner, so all corners
    are the exact worst case of the first-order model. `errors`: one or one each, m or rad; None: the
    machine file's ``encoder_error``. `nonlinear` also closes the machine at every corner, without
    linearising. `sharing`: what errors of drives that outnumber the freedoms do to the tool, ``least_norm`` or
    ``stiffness`` (docs/measures.md). Raises StiffmapError for bad input, never for a pose.
    """
    k = drive_kinematics(machine, position, rotation, sharing=sharing, threads=threads)
    out = accuracy_of(machine, k, errors=errors, plane=plane)
    return replace(out, nonlinear=_by_closing(machine, k, out.errors, threads)) if nonlinear else out


def accuracy_of(
    machine: Machine, k: DriveKinematics, *, errors: ArrayLike | None = None, plane: str = "xy"
) -> AccuracyTransmission:
    """The same from kinematics that are at hand, first order."""
    e = drive_values(machine, "encoder_error", errors, "m or rad", "errors")
    j = k.jacobian * e
    parts = (slice(0, 3), slice(3, 6), list(plane_axes(plane)))
    translation, rotation, in_plane = (farthest_vertex(j[..., rows, :]) for rows in parts)
    return AccuracyTransmission(
        translation, rotation, in_plane, components=np.abs(j).sum(axis=-1), corner=worst_corner(j[..., :3, :]), nonlinear=None, errors=e, status=k.status
    )  # fmt: skip


def _by_closing(machine: Machine, k: DriveKinematics, errors: Floats, threads: int | None) -> Floats:
    worst = np.zeros(k.status.shape)
    signs = corners(len(errors))
    for s in (*signs, *-signs):
        moved = (k.sharing @ (s * errors)[:, None])[..., 0]  # drives that go together move together
        there = forward_kinematics(machine, k.actuators + moved, threads=threads)
        worst = np.maximum(worst, np.linalg.norm(there.position - k.position, axis=-1))
    return worst


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
        found = held(machine, h, k, PUSHES, most, gravity)
        still = rest_efforts(machine, k, gravity=gravity, velocity=None)
        bias = as_tensions(machine, h, k, still, most, sharing)
    rows, room, offset = found
    with np.errstate(divide="ignore", invalid="ignore"):
        j = weighted(machine, k.jacobian, characteristic_length(machine, length), "all")
        s, last = of_motions(machine, k, singular_values(j))
        least, largest = 1 / s[..., 0], 1 / last
    section = section_polygon(rows[..., list(plane_axes(plane))], room, k.status, offset)
    return ForceTransmission(least, largest, inner_radius(*found), section, bias, most, k.status)
