"""The whole answer: the part as it will be, commands that make it right, and what they leave."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from stiffmap.broadcasting import Floats
from stiffmap.errors import StiffmapError
from stiffmap.kinematics import inverse_kinematics
from stiffmap.machine import Machine, as_machine
from stiffmap.milling.command import commanded
from stiffmap.milling.equilibrium import Equilibrium, equilibrium
from stiffmap.milling.passes import after_passes
from stiffmap.milling.plant import Plant
from stiffmap.milling.program import WITHIN, Program, program
from stiffmap.milling.reach import must_reach
from stiffmap.milling.ripple import ripple
from stiffmap.milling.setting import Setting, scaled, setting
from stiffmap.milling.stability import PathStability, path_stability
from stiffmap.milling.verify import Run, run
from stiffmap.performance.scaling import drive_table
from stiffmap.process import Process, load_process
from stiffmap.status import Flag, Status
from stiffmap.toolpath import Box, Toolpath, load_path, sampled

BAND = 0.2
"""Share of the force within which a result with a band holds."""


@dataclass(frozen=True, eq=False)
class Milled:
    """What `mill_job` found."""

    job: Setting
    before: Equilibrium
    command: Floats
    """(m, 3) m, base axes."""
    program: Program
    after: Run
    """The written program on the machine that it was made for."""
    dataset: xr.Dataset
    stability: PathStability | str
    """Whether the cut chatters along the path; a sentence where that cannot be judged."""
    true_before: Equilibrium | None = None
    true_after: Run | None = None


def mill(
    machine: Machine | str | PathLike[str],
    path: Toolpath | str | PathLike[str],
    process: Process | str | PathLike[str] | Mapping[str, Any],
    **options: Any,
) -> xr.Dataset:
    """The part as a machine will cut it, and compensated commands.

    Parameters
    ----------
    machine
        What is known of the machine: as declared, with the effects that a diagnosis or calibration found.
    path
        A built-in outline, a file (G-code, CL, CSV), or a `Toolpath` in the axes of the part, m.
    process
        Tool, law of the force, speeds and cut: a name, a file, a mapping.
    at, turn
        Where the part's origin lies (3,) m, base axes, and its turn about z, rad. None: the machine's home.
    true_machine
        Machine that the commands are also simulated on, as an experiment would find it.
    step, within
        m: distance of the points along the path; chord error of the written program.
    stock, thickness
        Box of stock (`stiffmap.toolpath.box`), or width to trim, m; None: the process's own cut.
    passes
        Number of passes along the same commands; each further one cuts what the last left (spring-back).
    band
        True: also under 80 and 120 % of the force.
    angle
        (points,) rad: turn of an arm's tool about its axis, from `redundancy`.
    threads
        None: all cores that this process may use.

    Returns
    -------
    Dataset
        Dimension point (along the path, each cut with both ends): `way` m, `wanted`, `command` (…, 3) m in base axes;
        `error` (…, 3) m before, its parts `error_normal` (positive: material stays on the part), `error_along`, `error_axial`;
        `error_normal_after` of the written program as simulated, at the same way; `mirror_left` what one mirror step leaves;
        `force` (…, 3) N, `gain` kp/k, `effort` N, N·m, `margin` m, `status`, `flags`, `ripple` m.

    Raises StiffmapError for bad input: paths that leave the workspace, cuts with the spindle off …
    """
    return mill_job(as_machine(machine), path, process, **options).dataset


def mill_job(
    machine: Machine,
    path: Toolpath | str | PathLike[str],
    process: Process | str | PathLike[str] | Mapping[str, Any],
    *,
    at: ArrayLike | None = None,
    turn: float = 0.0,
    true_machine: Machine | None = None,
    step: float = 2e-3,
    within: float = WITHIN,
    stock: Box | None = None,
    thickness: float | None = None,
    passes: int = 1,
    band: bool = False,
    angle: Floats | None = None,
    threads: int | None = None,
) -> Milled:
    """The same with the program and all states, for reports."""
    p = path if isinstance(path, Toolpath) else load_path(path)
    cut = process if isinstance(process, Process) else load_process(process)
    if passes < 1:
        raise StiffmapError(f"passes: expected 1 or more, got {passes}")
    place = p.placed(machine.description.home.p if at is None else at, turn)
    job = setting(machine, p, cut, sampled(p, step), place, stock=stock, thickness=thickness, angle=angle)
    must_reach(job, threads)
    plant = Plant(job, threads=threads)
    before = equilibrium(plant, job.position)
    found = commanded(plant, before)
    command = np.where(np.isfinite(found.position), found.position, job.position)
    made = program(job, command, within)
    after = run(job, made, step=step, threads=threads)
    mirrored = equilibrium(plant, np.where(np.isfinite(found.mirror), found.mirror, job.position))
    ds = _dataset(job, before, found.position, found.left, after, mirrored)
    ds["ripple"] = ("point", ripple(job, before))
    if passes > 1:
        ds["error_normal_passes"] = (("passes", "point"), after_passes(job, before, passes, threads))
    if band:
        for name, share in (("low", 1 - BAND), ("high", 1 + BAND)):
            ds[f"error_normal_after_{name}"] = _along(
                job, run(scaled(job, share), made, step=step, threads=threads)
            )
    stability = path_stability(job, threads)
    if isinstance(stability, PathStability):
        ds["multiplier"] = ("point", np.interp(job.points.way, stability.way, stability.multiplier))
    out = Milled(job, before, found.position, made, after, ds, stability)
    if true_machine is None:
        return out
    if true_machine.actuators != machine.actuators:
        raise StiffmapError(
            f"true_machine: expected the actuators {', '.join(machine.actuators)}, "
            f"got {', '.join(true_machine.actuators)}"
        )
    real = equilibrium(Plant(job, true_machine, threads), job.position)
    real_after = run(job, made, true_machine, step=step, threads=threads)
    ds["true_error_normal"] = ("point", (real.error * job.off).sum(axis=1))
    ds["true_error_normal_after"] = _along(job, real_after)
    return replace(out, true_before=real, true_after=real_after)


def _along(job: Setting, made: Run) -> xr.Variable:
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


def _dataset(
    job: Setting, before: Equilibrium, command: Floats, left: Floats, after: Run, mirrored: Equilibrium
) -> xr.Dataset:
    normal = (before.error * job.off).sum(axis=1)
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
            "error_normal_after": _along(job, after),
            "mirror_left": ("point", (mirrored.error * job.off).sum(axis=1)),
            "force": (xyz, before.force),
            "gain": ("point", before.gain),
            "effort": (("point", "actuator"), before.effort),
            "speed": (("point", "actuator"), drive_speeds(job)),
            "status": ("point", before.status),
            "flags": ("point", before.flags),
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
    if tolerance is not None:
        ds["margin"] = ("point", tolerance - np.abs(normal))
        ds["margin_after"] = tolerance - np.abs(ds.error_normal_after)
        ds.attrs["tolerance"] = tolerance
    return ds


def drive_speeds(job: Setting) -> Floats:
    """(m, actuators) m/s, rad/s at the feed; NaN out of reach."""
    ends = [
        inverse_kinematics(job.machine, job.position + s * 1e-5 * job.tangent, job.rotation).actuators
        for s in (-1, 1)
    ]
    return np.asarray((ends[1] - ends[0]) / 2e-5 * job.feed[:, None])


BROKEN = {"joint range": Flag.JOINT_LIMIT, "drive range": Flag.DRIVE_RANGE, "drive effort": Flag.DRIVE_FORCE}


def beyond(ds: xr.Dataset, machine: Machine) -> dict[str, int]:
    """Number of points that break each limit."""
    out = {name: int((ds.flags.values & flag > 0).sum()) for name, flag in BROKEN.items()}
    if machine.description.workspace is not None:
        low, high = (
            np.array(c) - 1e-9 * s for c, s in zip(machine.description.workspace, (1, -1), strict=True)
        )
        outside = ((ds.wanted.values < low) | (ds.wanted.values > high)).any(axis=1)
        out["declared workspace"] = int(outside.sum())
    most = np.array([d.speed if d.speed else np.inf for d in drive_table(machine)])
    out["drive speed"] = int((np.abs(ds.speed.values) > most).any(axis=1).sum())
    return out


def sizes(values: ArrayLike) -> dict[str, float]:
    """rms and largest size of errors (m), in mm; points without an answer do not count."""
    v = np.asarray(values, dtype=float)
    v = v[np.isfinite(v)]
    if not v.size:
        return {"rms": float("nan"), "largest": float("nan")}
    return {"rms": float(1e3 * np.sqrt((v**2).mean())), "largest": float(1e3 * np.abs(v).max())}


def verdict(ds: xr.Dataset) -> str:
    """One sentence."""
    bad = int((ds.status.values != Status.CONVERGED).sum())
    if (ds.status.values == Status.UNSTABLE).any():
        return f"The cut runs away at {int((ds.status.values == Status.UNSTABLE).sum())} points: the force grows faster than the machine resists."
    if bad:
        return f"{bad} of {ds.sizes['point']} points have no equilibrium."
    b, a = sizes(ds.error_normal), sizes(ds.error_normal_after)
    text = f"The part is off by {b['largest']:.3f} mm at most; with the compensated program by {a['largest']:.4f} mm."
    over = [name for name, flag in BROKEN.items() if (ds.flags.values & flag).any()]
    end = f" Limits are broken: {', '.join(over)}." if over else ""
    if "tolerance" not in ds.attrs:
        return text + end
    t = 1e3 * ds.attrs["tolerance"]
    words = [("within" if v["largest"] <= t else "beyond") for v in (b, a)]
    return f"{text} The tolerance is {t:g} mm: {words[0]} it as it is, {words[1]} it compensated.{end}"
