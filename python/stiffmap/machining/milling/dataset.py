"""Errors, commands and states of a job as one table along the path."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.machining.milling.equilibrium import Equilibrium
from stiffmap.machining.milling.limits import drive_speeds
from stiffmap.machining.milling.setting import Setting
from stiffmap.machining.milling.verify import Run


def along(job: Setting, made: Run) -> xr.Variable:
    """The error of a run at the points of the job: of the run's points nearest in way, the largest in size."""
    order = np.argsort(made.way, kind="stable")
    way, value = made.way[order], made.normal[order]
    edges = (job.points.way[1:] + job.points.way[:-1]) / 2
    bins = np.searchsorted(edges, way)
    out = np.interp(job.points.way, way, value)
    best = np.lexsort((np.abs(value), bins))
    last = np.r_[np.flatnonzero(np.diff(bins[best])), len(best) - 1]
    out[bins[best][last]] = value[best][last]
    return xr.Variable("point", out)


def flags_along(job: Setting, made: Run) -> NDArray[np.uint32]:
    """Flags of a run at the points of the job: all that its points between them have."""
    edges = (job.points.way[1:] + job.points.way[:-1]) / 2
    out = np.zeros(len(job), np.uint32)
    np.bitwise_or.at(out, np.searchsorted(edges, made.way), made.state.flags)
    return out


def dataset_of(
    job: Setting, before: Equilibrium, command: Floats, left: Floats, after: Run, mirrored: Equilibrium
) -> xr.Dataset:
    normal = job.across(before.error)
    tolerance = job.process.tolerance
    xyz = ("point", "axis")
    ds = xr.Dataset(
        {
            "wanted": (xyz, job.position),
            "error": (xyz, before.error),
            "error_normal": ("point", normal),
            "error_along": ("point", (before.error * job.tangent).sum(axis=1)),
            "error_axial": ("point", (before.error * job.tool).sum(axis=1)),
            "command": (xyz, command),
            "command_left": ("point", left),
            "error_normal_after": along(job, after),
            "mirror_left": ("point", job.across(mirrored.error)),
            "taper": ("point", taper(job, before)),
            "force": (xyz, before.force),
            "gain": ("point", before.gain),
            "effort": (("point", "actuator"), before.effort),
            "speed": (("point", "actuator"), drive_speeds(job)),
            "status": ("point", before.status),
            "flags": ("point", before.flags),
            "flags_after": ("point", flags_along(job, after)),
            "wall": ("point", job.engaged.wall),
            "width": ("point", job.width(np.zeros(len(job)))),
            "feed": ("point", job.feed),
        },
        coords={
            "way": ("point", job.points.way),
            "line": ("point", job.path.line[job.points.move]),
            "axis": ["x", "y", "z"],
            "actuator": list(job.machine.actuators),
        },
        attrs={
            "machine": job.machine.name,
            "process": job.process.name,
            "path": job.path.name,
            "at": job.place.at.tolist(),
            "turn": job.place.turn,
            "notes": list(job.path.notes),
        },
    )
    if job.angle is not None:
        ds["angle"] = ("point", job.angle)
    if tolerance is not None:
        ds["margin"] = ("point", tolerance - np.abs(normal))
        ds["margin_after"] = tolerance - np.abs(ds.error_normal_after)
        ds.attrs["tolerance"] = tolerance
    return ds


def taper(job: Setting, state: Equilibrium) -> Floats:
    """(m,) m across the wall, top of the cut less tip: the holder's turn, and the slope of a tool that bends (a cantilever's: 3/2 of
    its deflection over its length)."""
    depth, tool = job.engaged.axial, job.process.tool
    tilt = np.cross(state.turned, job.tool)
    if tool.compliance:
        across = state.force - (state.force * job.tool).sum(axis=1, keepdims=True) * job.tool
        tilt = tilt - 1.5 * tool.compliance / tool.stick_out * across
    return np.asarray(depth * (tilt * job.off).sum(axis=1))
