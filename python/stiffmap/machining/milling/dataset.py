"""Errors, commands and states of a job as one table along the path, sizes of the errors, and the verdict in words."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.machining.milling.equilibrium import Equilibrium
from stiffmap.machining.milling.limits import drive_speeds
from stiffmap.machining.milling.program import Run
from stiffmap.machining.milling.setting import Setting
from stiffmap.solve.status import Status


def along(job: Setting, made: Run) -> xr.Variable:
    """The error of a run at the points of the job: of the run's points nearest in way, the largest in size."""
    order = np.argsort(made.job.points.way, kind="stable")
    way, value = made.job.points.way[order], made.normal[order]
    edges = (job.points.way[1:] + job.points.way[:-1]) / 2
    bins = np.searchsorted(edges, way)
    out = np.interp(job.points.way, way, value)
    rising = np.lexsort((np.abs(value), bins))
    out[bins[rising]] = value[rising]  # of several in one place the last one, the largest
    return xr.Variable("point", out)


def flags_along(job: Setting, made: Run) -> NDArray[np.uint32]:
    """Flags of a run at the points of the job: all that its points between them have."""
    edges = (job.points.way[1:] + job.points.way[:-1]) / 2
    out = np.zeros(len(job), np.uint32)
    np.bitwise_or.at(out, np.searchsorted(edges, made.job.points.way), made.state.flags)
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


def sizes(values: ArrayLike) -> dict[str, float]:
    """rms and largest size of errors (m), in mm; points without an answer do not count."""
    v = np.asarray(values, dtype=float)
    v = v[np.isfinite(v)]
    if not v.size:
        return {"rms": float("nan"), "largest": float("nan")}
    return {"rms": float(1e3 * np.sqrt((v**2).mean())), "largest": float(1e3 * np.abs(v).max())}


def verdict(ds: xr.Dataset) -> str:
    """The worst of what was found comes first: no equilibrium, chatter, broken limits, errors."""
    states, points = ds.status.values, ds.sizes["point"]
    told = []
    away, bad = int((states == Status.UNSTABLE).sum()), int((states != Status.CONVERGED).sum())
    if away:
        told.append(f"The cut runs away at {away} points: the force grows faster than the machine resists.")
    elif bad:
        told.append(f"{bad} of {points} points have no equilibrium.")
    if "multiplier" in ds and (ds.multiplier.values > 1).any():
        told.append(f"{ds.multiplier.attrs['said']} The errors are those of a cut without chatter.")
    names = ds.warnings.attrs["names"] if "warnings" in ds else []
    over = [n for n in names if n not in ("chatter", "declared workspace", "outside corner")]
    if over:
        told.append(f"Limits are broken: {', '.join(over)}.")
    if bad:
        return " ".join(told)
    b, a = sizes(ds.error_normal), sizes(ds.error_normal_after)
    lost = int((~np.isfinite(ds.error_normal_after.values)).sum())
    told.append(f"The part is off by {b['largest']:.3f} mm at most; with the compensated program ")
    if lost:
        told[-1] += f"{lost} of {points} points have no equilibrium."
        return " ".join([told.pop(), *told])
    told[-1] += f"by {a['largest']:.4f} mm."
    if "tolerance" in ds.attrs:
        t = 1e3 * ds.attrs["tolerance"]
        words = [("within" if v["largest"] <= t else "beyond") for v in (b, a)]
        told.append(f"The tolerance is {t:g} mm: {words[0]} it as it is, {words[1]} it compensated.")
    return " ".join(told)
