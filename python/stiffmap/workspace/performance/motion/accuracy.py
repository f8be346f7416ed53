"""Accuracy transmission, equation (1) of the paper: encoder errors to tool error (docs/measures.md)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.common.short import short_repr
from stiffmap.solve.kinematics import forward_kinematics
from stiffmap.solve.machine import Machine, takes_machine
from stiffmap.solve.results import OverPoses
from stiffmap.workspace.maps.inputs import plane_axes
from stiffmap.workspace.performance.motion.closing import DriveKinematics, drive_kinematics
from stiffmap.workspace.performance.motion.scaling import drive_values
from stiffmap.workspace.performance.motion.zonotopes import corners, farthest_vertex, worst_corner


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
    if not nonlinear:
        return out
    moved = _by_closing(machine, k, out.errors, threads)
    return AccuracyTransmission(**{**out.__dict__, "nonlinear": moved})


def accuracy_of(
    machine: Machine, k: DriveKinematics, *, errors: ArrayLike | None = None, plane: str = "xy"
) -> AccuracyTransmission:
    """The same from kinematics that are at hand, first order."""
    e = drive_values(machine, "encoder_error", errors, "m or rad")
    j = k.jacobian * e
    return AccuracyTransmission(
        translation=farthest_vertex(j[..., :3, :]),
        rotation=farthest_vertex(j[..., 3:, :]),
        plane=farthest_vertex(j[..., list(plane_axes(plane)), :]),
        components=np.abs(j).sum(axis=-1),
        corner=worst_corner(j[..., :3, :]),
        nonlinear=None,
        errors=e,
        status=k.status,
    )


def _by_closing(machine: Machine, k: DriveKinematics, errors: Floats, threads: int | None) -> Floats:
    worst = np.zeros(k.status.shape)
    signs = corners(len(errors))
    for s in (*signs, *-signs):
        moved = (k.sharing @ (s * errors)[:, None])[..., 0]  # drives that go together move together
        there = forward_kinematics(machine, k.actuators + moved, threads=threads)
        worst = np.maximum(worst, np.linalg.norm(there.position - k.position, axis=-1))
    return worst
