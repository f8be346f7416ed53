"""Efforts of the drives along a trajectory, equation (4) of the paper (docs/theory.md D4-D6)."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats, instance_of
from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import place_text
from stiffmap.solve.machine import Machine, takes_machine
from stiffmap.workspace.performance.motion.closing import (
    DriveKinematics,
    declared,
    drive_kinematics,
    drive_table,
    drive_values,
    refuse_failed,
    revolute_drives,
)
from stiffmap.workspace.performance.motion.inertia import (
    as_tensions,
    held,
    in_cables,
    inertia_columns,
    motion_friction,
    need_masses,
    rest_efforts,
    rigid_dynamics,
)
from stiffmap.workspace.performance.motion.many_drives import inner_radius, inverse_rows
from stiffmap.workspace.performance.motion.trajectory import Trajectory

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
    return _dataset(machine, t, k, out, friction_effort)


def _dataset(
    machine: Machine, t: Trajectory, k: DriveKinematics, out: dict[str, Floats], friction_effort: Floats
) -> xr.Dataset:
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
    """(...) m/s²: acceleration of the tool that the drives reach in every direction, from rest, orientation kept.

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
    needed = mass @ inverse_rows(k.jacobian)[..., :3]  # effort per acceleration of the TCP
    return inner_radius(needed, most, bias)
