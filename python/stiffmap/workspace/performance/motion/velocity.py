"""Velocity transmission of §3.1: sphere, cube and hexagon of Figure 1, and equation (1) of the paper: what errors of encoders
do to the tool (docs/measures.md)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.common.short import short_repr
from stiffmap.model.files.load import Source
from stiffmap.solve.kinematics import forward_kinematics
from stiffmap.solve.labels import OverPoses
from stiffmap.solve.machine import Machine, as_machine, takes_machine
from stiffmap.solve.options import keywords_of
from stiffmap.workspace.maps.inputs import plane_axes
from stiffmap.workspace.performance.motion.closing import (
    DriveKinematics,
    characteristic_length,
    commanded_axes,
    commanded_jacobian,
    drive_kinematics,
    drive_limits,
    drive_values,
    weighted,
)
from stiffmap.workspace.performance.motion.many_drives import (
    Polygon,
    corners,
    facets,
    farthest_vertex,
    inverse_rows,
    of_motions,
    rows_limit,
    section_polygon,
    sides,
    worst_corner,
)


@short_repr
@dataclass(frozen=True, eq=False)
class VelocityTransmission(OverPoses):
    """Transmission factors at poses (...); NaN where the pose failed, and its status."""

    sphere_min: Floats
    """(...) smallest singular value of the weighted Jacobian."""
    sphere_max: Floats
    """(...) largest singular value."""
    cube_min: Floats
    """(...) largest speed that the machine reaches in every direction (the other components of its
    own motion held at zero), each drive within its limit."""
    cube_max: Floats
    """(...) largest speed in any direction, each drive within its limit: the farthest vertex."""
    condition: Floats
    """(...) sphere_max / sphere_min."""
    manipulability: Floats
    """(...) product of the singular values."""
    jacobian: Floats
    """(..., 6, drives) as it is, SI."""
    length: float
    """m, characteristic length: rotations (of the platform and of drives) count as this arc."""
    limits: Floats
    """(drives,) limit of each drive's rate that the cube uses."""
    status: NDArray[np.uint8]
    flags: NDArray[np.uint32]


def transmission_of(
    machine: Machine,
    k: DriveKinematics,
    *,
    length: float | None = None,
    limits: ArrayLike | str = "unit",
    part: str = "all",
) -> VelocityTransmission:
    """`velocity_transmission` from kinematics that are at hand."""
    speeds = drive_limits(machine, "speed", limits, "m/s or rad/s")
    size = characteristic_length(machine, length)
    j = weighted(machine, k.jacobian, size, part)
    driven = j * speeds
    s, low = of_motions(k.together, singular_values(j), machine.compiled.core.redundancy)
    high = s[..., 0]
    if part == "translation" or (part == "all" and machine.compiled.core.redundancy):
        rank = 3 if part == "translation" else _rank(s)
        slowest = facets(driven, rank)[1].min(axis=-1, initial=np.inf)
        slowest = np.where(np.isinf(slowest), 0.0, slowest)  # no facets: some motion has no drive
    else:
        slowest = rows_limit(inverse_rows(j), speeds)
    with np.errstate(invalid="ignore", divide="ignore"):
        return VelocityTransmission(
            sphere_min=low, sphere_max=high, cube_min=slowest, cube_max=farthest_vertex(driven),
            condition=high / low, manipulability=np.nanprod(s, axis=-1) + 0 * high,
            jacobian=k.jacobian, length=size, limits=speeds, status=k.status, flags=k.flags,
        )  # fmt: skip


APART = 0.1  # the loops lose rank at type 2 as well, but not that much faster than the tool runs away


def distances(v: VelocityTransmission, pivot: Floats) -> Floats:
    """(3, ...) numbers from 0 (singular) to 1, one for each type.

    Type 1: smallest transmission factor. Type 2: one over the largest. Constraint: root of the relative pivot of
    the loops' normal matrix with the drives held, 1 unless it is far smaller than the number of type 2.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        one, two, loops = v.sphere_min, 1 / v.sphere_max, np.sqrt(pivot)
        third = np.where(loops < APART * two, loops, 1.0)
    return np.asarray(np.minimum(np.stack([one, two, third]), 1.0))


@keywords_of(transmission_of)
def velocity_transmission(
    machine: Machine | Source,
    position: ArrayLike,
    rotation: ArrayLike | None = None,
    *,
    threads: int | None = None,
    **how: Any,
) -> VelocityTransmission:
    """How fast the tool moves per speed of the drives, at poses (..., 3) m.

    Parameters
    ----------
    position, rotation
        (..., 3) m and (..., 3, 3); None: orientation as at home.
    length
        Characteristic length, m, where units mix; None: the machine's own. It changes every factor of a
        machine whose platform or drives turn, and nothing else.
    limits
        ``unit``: each drive within one unit of speed, so that all factors compare; ``declared``: the
        speeds of the machine file, so that the cube's factors are speeds (m/s); or numbers.
    part
        ``all`` components of the twist, or its ``translation`` or ``rotation`` alone.

    Raises
    ------
    StiffmapError
        For bad input, never for a pose.
    """
    machine = as_machine(machine)
    return transmission_of(machine, drive_kinematics(machine, position, rotation, threads=threads), **how)


def _rank(values: Floats) -> int:
    """The most singular values (..., n) that a pose has above zero."""
    return int((np.isfinite(values) & (values > 0)).sum(axis=-1).max(initial=1))


def singular_values(j: Floats) -> Floats:
    """(..., min(rows, drives)) largest first; NaN rows where the matrix is NaN."""
    out = np.full((*j.shape[:-2], min(j.shape[-2:])), np.nan)
    ok = np.isfinite(j).all(axis=(-2, -1))
    poor = ok
    if j.shape[-1] <= j.shape[-2]:  # the small symmetric problem is several times quicker
        gram = np.swapaxes(j[ok], -1, -2) @ j[ok]
        out[ok] = np.sqrt(np.maximum(np.linalg.eigvalsh(gram)[..., ::-1], 0.0))
        poor = ok & (out[..., -1] < 1e-5 * out[..., 0])  # squaring lost their digits
    out[poor] = np.linalg.svd(j[poor], compute_uv=False)
    return out


@takes_machine
def velocity_section(
    machine: Machine,
    position: ArrayLike,
    rotation: ArrayLike | None = None,
    *,
    plane: str = "xy",
    limits: ArrayLike | str = "unit",
    threads: int | None = None,
) -> Polygon:
    """Velocities that the TCP reaches in a plane, all other components of its twist that are commanded zero (Figure 1c).

    The polygon's vertices (..., 2 drives, 2), inner radius (the speed reached in every direction) and
    outer radius; m/s with ``limits="declared"`` or numbers, else per unit speed of the drives.
    Raises StiffmapError for bad input and for a plane that the machine's task does not command, never for a pose.
    """
    k = drive_kinematics(machine, position, rotation, threads=threads)
    speeds = drive_limits(machine, "speed", limits, "m/s or rad/s")
    j, axes = commanded_jacobian(machine, k), commanded_axes(machine, plane)
    if machine.compiled.core.redundancy:
        rank = _rank(of_motions(k.together, singular_values(j), machine.compiled.core.redundancy)[0])
        rows, most = sides(j * speeds, rank)
        return section_polygon(rows[..., axes], most, k.status)
    return section_polygon(inverse_rows(j)[..., axes], speeds, k.status)


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
