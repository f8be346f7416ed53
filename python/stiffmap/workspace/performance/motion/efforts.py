"""Efforts of the drives: what they hold at the tool, equation (2) of the paper, and what a trajectory asks of them, equation (4)
(docs/measures.md, docs/theory.md D4-D6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from stiffmap.common.broadcasting import Floats, instance_of
from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import place_text
from stiffmap.common.short import short_repr
from stiffmap.solve.labels import OverPoses
from stiffmap.solve.machine import Machine, takes_machine
from stiffmap.workspace.maps.inputs import plane_axes
from stiffmap.workspace.performance.motion.closing import (
    DriveKinematics,
    characteristic_length,
    commanded_jacobian,
    declared,
    drive_kinematics,
    drive_limits,
    drive_table,
    drive_values,
    refuse_failed,
    revolute_drives,
    weighted,
)
from stiffmap.workspace.performance.motion.inertia import (
    PUSHES,
    Held,
    as_tensions,
    held,
    in_cables,
    inertia_columns,
    motion_friction,
    need_masses,
    rest_efforts,
    rigid_dynamics,
)
from stiffmap.workspace.performance.motion.many_drives import (
    NOTHING,
    Polygon,
    inner_radius,
    inverse_rows,
    of_motions,
    section_polygon,
)
from stiffmap.workspace.performance.motion.trajectory import Trajectory
from stiffmap.workspace.performance.motion.velocity import singular_values

IMPOSSIBLE = 1e-6  # relative part of a motion that the machine cannot do: above it, the trajectory is refused


@takes_machine
def drive_efforts(
    machine: Machine,
    trajectory: Trajectory,
    *,
    rotation: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    friction: bool = True,
    sharing: str = "least_norm",
    threads: int | None = None,
) -> xr.Dataset:
    """What each drive exerts along a motion of the tool: effort, power, speed, their peaks and rms.

    Newton and Euler for every body of the closed machine, projected on the drives; Coulomb and viscous
    friction of the drives, springs of passive joints and external springs, `Trajectory.force` on the
    tool. gravity (3,) m/s²; None: what the machine file says. sharing: of drives that outnumber the freedoms,
    ``least_norm`` or ``stiffness`` (docs/measures.md). The joints of a redundant machine are those nearest to home.
    Efforts of winches are minus the tensions of their cables, none of which pushes.

    Returns a Dataset over (time, drive): effort, rate, acceleration, coordinate, power, friction; over
    time: kinetic, potential (J); over drive: peak_effort, rms_effort, peak_speed, peak_power,
    effort_margin, speed_margin (limit minus peak) and range_margin (distance from the nearer end of the
    range), NaN where none is declared. SI units.

    Raises StiffmapError where masses are missing (names the bodies) and where the path leaves the
    reach or meets a singularity (says where and when).
    """
    need_masses(machine, "inverse dynamics")
    h = in_cables(machine, "inverse dynamics")
    t = instance_of(trajectory, Trajectory, "trajectory", "a Trajectory")
    k = drive_kinematics(machine, t.position, rotation, sharing=sharing, threads=threads)
    refuse_failed(machine, k, t.time, t.position)
    zero = np.zeros_like(t.position)
    out = rigid_dynamics(
        machine, k.coordinates, np.hstack([t.velocity, zero]), np.hstack([t.acceleration, zero]),
        np.hstack([t.force, zero]), gravity, threads, sharing=sharing,
    )  # fmt: skip
    bad = ~(out["misfit"] < IMPOSSIBLE)
    if bad.any():
        i = int(np.argmax(bad))
        raise StiffmapError(
            f"{machine.name}: the trajectory asks for a motion that the machine cannot do at "
            f"{place_text(t.position[i], '.1f')}, t = {t.time[i]:.4g} s (its drives leave {out['misfit'][i]:.1e} of it open)"
        )
    if h is not None:
        out["effort"] = as_tensions(machine, h, k, out["effort"], h.most, sharing)
        slack = np.isnan(out["effort"]).any(axis=-1)
        if slack.any():
            i = int(np.argmax(slack))
            raise StiffmapError(
                f"{machine.name}: no tensions between 0 and the largest ones hold the motion at "
                f"{place_text(t.position[i], '.1f')}, t = {t.time[i]:.4g} s"
            )
    friction_effort = motion_friction(machine, out["rate"]) if friction else np.zeros_like(out["rate"])
    effort = out["effort"] + friction_effort
    power = effort * out["rate"]
    span = t.time[-1] - t.time[0]
    peak_effort, peak_speed = np.abs(effort).max(axis=0), np.abs(out["rate"]).max(axis=0)
    ends = np.array([d.range or (np.nan, np.nan) for d in drive_table(machine)])
    room = np.minimum(k.actuators - ends[:, 0], ends[:, 1] - k.actuators).min(axis=0)
    over = ("time", "drive")
    return xr.Dataset(
        {
            "effort": (over, effort, {"units": "N or N m"}),
            "friction": (over, friction_effort, {"units": "N or N m"}),
            "rate": (over, out["rate"], {"units": "m/s or rad/s"}),
            "acceleration": (over, out["acceleration"]),
            "coordinate": (over, k.actuators, {"units": "m or rad"}),
            "power": (over, power, {"units": "W"}),
            "kinetic": ("time", out["kinetic"], {"units": "J"}),
            "potential": ("time", out["potential"], {"units": "J"}),
            "peak_effort": ("drive", peak_effort),
            "rms_effort": ("drive", np.sqrt(np.trapezoid(effort**2, t.time, axis=0) / span)),
            "peak_speed": ("drive", peak_speed),
            "peak_power": ("drive", np.abs(power).max(axis=0)),
            "effort_margin": ("drive", declared(machine, "force", np.nan) - peak_effort),
            "speed_margin": ("drive", declared(machine, "speed", np.nan) - peak_speed),
            "range_margin": ("drive", room),
        },
        coords={"time": t.time, "drive": list(machine.actuators)},
        attrs={"machine": machine.name, "revolute": revolute_drives(machine).astype(int).tolist()},
    )


def acceleration_of(
    machine: Machine,
    k: DriveKinematics,
    *,
    efforts: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
) -> Floats:
    """(...) m/s²: acceleration of the tool that the drives reach in every commanded direction, from rest, commanded turns kept.

    efforts: limits of the drives, N or N·m (one or one each); None: the machine file's. Gravity counts
    against them. StiffmapError where masses are missing.
    """
    need_masses(machine, "acceleration")
    most = drive_values(machine, "force", efforts, "N or N·m")
    shape, n = k.status.shape, len(most)
    if (h := in_cables(machine, "acceleration")) is not None:
        return inner_radius(*held(machine, h, k, inertia_columns(h, k.rotation), most, gravity))
    bias = rest_efforts(machine, k, gravity=gravity, velocity=None)
    flat = k.coordinates.reshape(-1, k.coordinates.shape[-1])
    zero = np.zeros((len(flat), 6))
    mass = rigid_dynamics(machine, flat, zero, zero, zero, np.zeros(3))["mass"].reshape((*shape, n, n))
    needed = mass @ inverse_rows(commanded_jacobian(machine, k))[..., :3]
    return inner_radius(needed, most, bias)


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
        (3,) m/s²; None: what the machine file says. Its efforts and those of springs count against the limits.
    velocity
        (..., 3) m/s of the TCP, no acceleration, no rotation: inertia and friction at that speed count
        against the limits too; None: at rest, without friction.
    sharing
        Of drives that outnumber the freedoms: ``least_norm`` or ``stiffness`` (docs/measures.md).

    Raises StiffmapError for bad input, never for a pose.
    """
    k = drive_kinematics(machine, position, rotation, sharing=sharing, threads=threads)
    most = drive_limits(machine, "force", limits, "N or N·m")
    rows, room, bias = found = held_forces(machine, k, most, gravity, velocity, sharing)
    section = section_polygon(rows[..., list(plane_axes(plane))], room, k.status, bias)
    if (h := in_cables(machine, HELD)) is not None:
        still = rest_efforts(machine, k, gravity=gravity, velocity=None)
        bias = as_tensions(machine, h, k, still, most, sharing)
    with np.errstate(divide="ignore", invalid="ignore"):
        j = weighted(machine, k.jacobian, characteristic_length(machine, length), "all")
        s, last = of_motions(k.together, singular_values(j), machine.compiled.core.redundancy)
        least, largest = 1 / s[..., 0], 1 / last
    return ForceTransmission(least, largest, inner_radius(*found), section, bias, most, k.status)


HELD = "the force that is held"


def held_forces(
    machine: Machine, k: DriveKinematics, most: Floats, gravity: ArrayLike | None, velocity: ArrayLike | None = None,
    sharing: str = "least_norm",
) -> Held:  # fmt: skip
    """Forces (3,) on the tool that efforts up to `most` (drives,) hold next to those that the machine itself needs."""
    if (h := in_cables(machine, HELD)) is None:
        bias = rest_efforts(machine, k, gravity=gravity, velocity=velocity, sharing=sharing)
        j = np.abs(k.jacobian)
        exact = np.where(j < NOTHING * j.max(axis=(-2, -1), keepdims=True), 0.0, k.jacobian)
        return -np.swapaxes(exact[..., :3, :], -1, -2), most, bias  # effort per force on the tool
    if velocity is not None:
        raise StiffmapError(f"{machine.name}: velocity: for cables the force is known at rest alone")
    return held(machine, h, k, PUSHES, most, gravity)
