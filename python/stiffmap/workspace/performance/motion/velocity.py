"""Velocity transmission of §3.1: sphere, cube and hexagon of Figure 1 (docs/measures.md)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.common.short import short_repr
from stiffmap.model.files.load import Source
from stiffmap.solve.labels import OverPoses
from stiffmap.solve.machine import Machine, as_machine, takes_machine
from stiffmap.solve.options import keywords_of
from stiffmap.workspace.maps.inputs import plane_axes
from stiffmap.workspace.performance.motion.closing import (
    DriveKinematics,
    characteristic_length,
    drive_kinematics,
    drive_limits,
    weighted,
)
from stiffmap.workspace.performance.motion.many_drives import (
    Polygon,
    facets,
    farthest_vertex,
    inverse_rows,
    motions,
    rows_limit,
    section_polygon,
    sides,
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
    dexterity: Floats
    """(...) 1 / condition."""
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
    s, low = of_motions(machine, k, singular_values(j))
    high = s[..., 0]
    if part == "translation" or (part == "all" and machine.compiled.redundancy):
        rank = 3 if part == "translation" else _rank(s)
        slowest = facets(driven, rank)[1].min(axis=-1, initial=np.inf)
        slowest = np.where(np.isinf(slowest), 0.0, slowest)  # no facets: some motion has no drive
    else:
        slowest = rows_limit(inverse_rows(j), speeds)
    with np.errstate(invalid="ignore", divide="ignore"):
        return VelocityTransmission(
            sphere_min=low, sphere_max=high, cube_min=slowest, cube_max=farthest_vertex(driven),
            condition=high / low, dexterity=low / high, manipulability=np.nanprod(s, axis=-1) + 0 * high,
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


def of_motions(machine: Machine, k: DriveKinematics, values: Floats) -> tuple[Floats, Floats]:
    """Singular values (..., n), those beyond the tool's motions NaN, and the last one that counts.

    Drives that go together, or that leave the tool where it is, have none of their own.
    """
    redundancy, drives = machine.compiled.redundancy, k.jacobian.shape[-1]
    if not redundancy and not (k.together < drives).any():
        return values, values[..., -1]
    count = motions(k.together, values, redundancy)
    last = np.take_along_axis(values, np.maximum(count - 1, 0)[..., None], axis=-1)[..., 0]
    return np.where(np.arange(values.shape[-1]) < count[..., None], values, np.nan), last


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
    """Velocities that the TCP reaches in a plane, all other components of its twist zero (Figure 1c).

    The polygon's vertices (..., 2 drives, 2), inner radius (the speed reached in every direction) and
    outer radius; m/s with ``limits="declared"`` or numbers, else per unit speed of the drives.
    """
    k = drive_kinematics(machine, position, rotation, threads=threads)
    speeds = drive_limits(machine, "speed", limits, "m/s or rad/s")
    j = weighted(machine, k.jacobian, 1.0, "all")
    axes = list(plane_axes(plane))
    if machine.compiled.redundancy:
        rank = _rank(of_motions(machine, k, singular_values(j))[0])
        rows, most = sides(k.jacobian * speeds, rank)
        return section_polygon(rows[..., axes], most, k.status)
    return section_polygon(inverse_rows(j)[..., axes], speeds, k.status)
