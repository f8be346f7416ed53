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
from stiffmap.workspace.cables.structure import Hanging
from stiffmap.workspace.maps.inputs import plane_axes
from stiffmap.workspace.performance.motion.closing import DriveKinematics, drive_kinematics
from stiffmap.workspace.performance.motion.inertia import rest_efforts
from stiffmap.workspace.performance.motion.polygons import Polygon, section_polygon
from stiffmap.workspace.performance.motion.scaling import characteristic_length, drive_values, weighted
from stiffmap.workspace.performance.motion.tensions import as_tensions, held, in_cables, pushes, radius
from stiffmap.workspace.performance.motion.velocity import of_motions, singular_values

NOTHING = 1e-12
"""Effort of a drive per unit force below which the drive does not feel the force."""


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
    return force_of(
        machine,
        k,
        plane=plane,
        limits=limits,
        gravity=gravity,
        velocity=velocity,
        length=length,
        sharing=sharing,
    )


def force_of(
    machine: Machine,
    k: DriveKinematics,
    *,
    plane: str = "xy",
    limits: ArrayLike | str = "declared",
    gravity: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    length: float | None = None,
    sharing: str = "least_norm",
) -> ForceTransmission:
    """The same from kinematics that are at hand."""
    text = limits if isinstance(limits, str) else ""
    given = np.ones(()) if text == "unit" else None if text == "declared" else limits
    most = drive_values(machine, "force", given, "N or N·m")
    if (h := in_cables(machine, "the force that is held")) is not None:
        return _of_cables(machine, h, k, most, plane, gravity, velocity, length, sharing)
    bias = rest_efforts(machine, k, gravity=gravity, velocity=velocity, sharing=sharing)
    needed = -np.swapaxes(k.jacobian[..., :3, :], -1, -2)  # effort of the drives per force on the tool
    free = most - np.abs(bias)
    norms = np.linalg.norm(needed, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        room = np.where(norms > NOTHING, free / norms, np.where(free >= 0, np.inf, 0.0))
    least, largest = _spheres(machine, k, length)
    bad = ~np.isfinite(needed).all(axis=(-2, -1))
    return ForceTransmission(
        sphere_min=least,
        sphere_max=largest,
        force_min=np.where(bad, np.nan, np.maximum(room.min(axis=-1), 0.0)),
        plane=section_polygon(needed[..., list(plane_axes(plane))], most, k.status, bias),
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


def _of_cables(
    machine: Machine, h: Hanging, k: DriveKinematics, most: Floats, plane: str, gravity: ArrayLike | None,
    velocity: ArrayLike | None, length: float | None, sharing: str,
) -> ForceTransmission:  # fmt: skip
    """Tensions between 0 and the limits, whichever they are, moments balanced."""
    if velocity is not None:
        raise StiffmapError(f"{machine.name}: velocity: for cables the force is known at rest alone")
    rows, limits, offset = found = held(machine, h, k, pushes(h), most, gravity)
    bias = as_tensions(machine, h, k, rest_efforts(machine, k, gravity=gravity, velocity=None), most, sharing)
    least, largest = _spheres(machine, k, length)
    return ForceTransmission(
        sphere_min=least,
        sphere_max=largest,
        force_min=radius(found),
        plane=section_polygon(rows[..., list(plane_axes(plane))], limits, k.status, offset),
        bias=bias,
        limits=most,
        status=k.status,
    )
