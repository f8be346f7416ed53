"""Ranges, efforts and speeds of the drives along a job."""

from __future__ import annotations

import numpy as np
import xarray as xr

from stiffmap.common.broadcasting import Floats
from stiffmap.machining.milling.setting import Setting
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.machine import Machine
from stiffmap.solve.status import Flag
from stiffmap.workspace.performance.motion.scaling import drive_table

BROKEN = {"joint range": Flag.JOINT_LIMIT, "drive range": Flag.DRIVE_RANGE, "drive effort": Flag.DRIVE_FORCE}


def drive_speeds(job: Setting) -> Floats:
    """(m, actuators) m/s, rad/s at the feed; NaN out of reach."""
    ends = [
        inverse_kinematics(job.machine, job.position + s * 1e-5 * job.tangent, job.rotation).actuators
        for s in (-1, 1)
    ]
    return np.asarray((ends[1] - ends[0]) / 2e-5 * job.feed[:, None])


def fastest(machine: Machine) -> Floats:
    """(actuators,) m/s, rad/s; infinite where none is declared."""
    return np.array([d.speed if d.speed else np.inf for d in drive_table(machine)])


def outside(ds: xr.Dataset, machine: Machine) -> dict[str, np.ndarray]:
    """Points (m,) bool that break each limit, as they are cut or as compensated."""
    flags = ds.flags.values | ds.flags_after.values
    out = {name: np.asarray(flags & flag > 0) for name, flag in BROKEN.items()}
    out["drive speed"] = (np.abs(ds.speed.values) > fastest(machine)).any(axis=1)
    if machine.description.workspace is not None:
        low, high = (
            np.array(c) - 1e-9 * s for c, s in zip(machine.description.workspace, (1, -1), strict=True)
        )
        out["declared workspace"] = ((ds.wanted.values < low) | (ds.wanted.values > high)).any(axis=1)
    return out
