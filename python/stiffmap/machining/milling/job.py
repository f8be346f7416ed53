"""The whole answer: the part as it will be, commands that make it right, and what they leave."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.machining.milling.dataset import along, dataset_of
from stiffmap.machining.milling.equilibrium import Equilibrium, equilibrium
from stiffmap.machining.milling.plant import Plant
from stiffmap.machining.milling.program import WITHIN, Program, program
from stiffmap.machining.milling.reach import must_reach
from stiffmap.machining.milling.setting import Setting, scaled, setting
from stiffmap.machining.milling.speed import Feeds, best_feeds
from stiffmap.machining.milling.stability import PathStability, path_stability
from stiffmap.machining.milling.verify import Run, run
from stiffmap.machining.milling.warnings import Warned, warned
from stiffmap.machining.process import Process, cutting_force, load_process
from stiffmap.machining.toolpath import Box, Toolpath, load_path, sampled
from stiffmap.solve.machine import Machine, as_machine
from stiffmap.solve.options import keywords_of
from stiffmap.workspace.performance.motion.inertia import natural_frequencies

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
    feeds: Feeds | None = None
    warnings: tuple[Warned, ...] = ()
    """What is to be watched, and at which points."""


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
    feeds: bool = False,
    threads: int | None = None,
) -> Milled:
    """The same with the program and all states, for reports."""
    cut = process if isinstance(process, Process) else load_process(process)
    p = path if isinstance(path, Toolpath) else load_path(path, feed=cut.feed, spindle=cut.spindle)
    if passes < 1:
        raise StiffmapError(f"passes: expected 1 or more, got {passes}")
    place = p.placed(machine.description.home.p if at is None else at, turn)
    if angle is not None:
        p = replace(p, turn=None)
    job = setting(machine, p, cut, sampled(p, step), place, stock=stock, thickness=thickness, angle=angle)
    must_reach(job, threads)
    chosen = best_feeds(job, threads=threads) if feeds else None
    if chosen is not None:
        p = replace(p, feed=chosen.feed)
        job = setting(machine, p, cut, sampled(p, step), place, stock=stock, thickness=thickness, angle=angle)
    plant = Plant(job, threads=threads)
    before = equilibrium(plant, job.position)
    found = commanded(plant, before)
    command = np.where(np.isfinite(found.position), found.position, job.position)
    made = program(job, command, within, None if chosen is None else chosen.feed)
    after = run(job, made, step=step, threads=threads)
    mirrored = equilibrium(plant, np.where(np.isfinite(found.mirror), found.mirror, job.position))
    ds = dataset_of(job, before, found.position, found.left, after, mirrored)
    ds["ripple"] = ("point", ripple(job, before))
    if passes > 1:
        ds["error_normal_passes"] = (("passes", "point"), after_passes(job, before, passes, threads))
    if band:
        for name, share in (("low", 1 - BAND), ("high", 1 + BAND)):
            ds[f"error_normal_after_{name}"] = along(
                job, run(scaled(job, share), made, step=step, threads=threads)
            )
    stability = path_stability(job, threads)
    if isinstance(stability, PathStability):
        ds["multiplier"] = ("point", np.interp(job.points.way, stability.way, stability.multiplier))
        ds["multiplier"].attrs["said"] = stability.sentence(job.process.spindle)
    out = Milled(
        job, before, found.position, made, after, ds, stability, feeds=chosen, warnings=warned(job, ds)
    )
    if true_machine is None:
        return out
    if true_machine.actuators != machine.actuators:
        raise StiffmapError(
            f"true_machine: expected the actuators {', '.join(machine.actuators)}, "
            f"got {', '.join(true_machine.actuators)}"
        )
    real = equilibrium(Plant(job, true_machine, threads), job.position)
    real_after = run(job, made, true_machine, step=step, threads=threads)
    ds["true_error_normal"] = ("point", job.across(real.error))
    ds["true_error_normal_after"] = along(job, real_after)
    return replace(out, true_before=real, true_after=real_after)


@keywords_of(mill_job)
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
        A built-in outline (at the process's own feed and speed), a file (G-code, CL, CSV), or a `Toolpath` in the axes of the part, m.
    process
        Tool, law of the force, speeds and cut: a name, a file, a mapping.
    at, turn
        Where the part's origin lies (3,) m, base axes, and its turn about z, rad. None: the machine's home.
    true_machine
        Machine that the commands are also simulated on, as an experiment would find it.
    step, within
        m: distance of the points along the path; chord error of the written program.
    stock, thickness
        Box of stock (`stiffmap.machining.toolpath.box`), or width to trim, m; None: the process's own cut.
    passes
        Number of passes along the same commands; each further one cuts what the last left (spring-back).
    band
        True: also under 80 and 120 % of the force.
    angle
        (points,) rad: turn of an arm's tool about its axis, from `redundancy`; None: that of the path (C), else as at home.
    feeds
        True: the largest feed of each move at which the error stays within the tolerance; the program has them.
    threads
        None: all cores that this process may use.

    Returns
    -------
    Dataset
        Dimension point (along the path, each cut with both ends): `way` m, `wanted`, `command` (…, 3) m in base axes;
        `error` (…, 3) m before, its parts `error_normal` (positive: material stays on the part), `error_along`, `error_axial`;
        `error_normal_after` of the written program as simulated, at the same way; `mirror_left` what one mirror step leaves;
        `force` (…, 3) N, `gain` kp/k, `effort` N, N·m, `margin` m, `status`, `flags`, `ripple` m; `taper` m, how much
        further out the wall is at the top of the cut than at the tip; `warnings`, a bit for each of its attribute `names`.

    Raises
    ------
    StiffmapError
        For bad input: paths that leave the workspace, cuts with the spindle off ….
    """
    return mill_job(as_machine(machine), path, process, **options).dataset


def after_passes(job: Setting, first: Equilibrium, passes: int, threads: int | None = None) -> Floats:
    """(passes, m) m: height of the wall over the wanted one after each pass; never below what a pass before it took."""
    wall = job.across(first.error)
    out = [wall]
    for _ in range(passes - 1):
        engaged = replace(
            job.engaged, radial=np.maximum(np.nan_to_num(wall), 0.0), corner=0 * job.engaged.corner
        )
        rest = replace(job, engaged=engaged)
        e = equilibrium(Plant(rest, threads=threads), job.position)
        wall = np.minimum(wall, job.across(e.error))
        out.append(wall)
    return np.array(out)


SLOW = 3.0
"""The lowest natural frequency must be this many times the tooth passing's."""


def ripple(job: Setting, state: Equilibrium) -> Floats:
    """(m,) m: amplitude across the wall at the tooth-passing frequency; 0 for a coated tool, NaN where the teeth pass
    too fast for statics or the machine declares no masses."""
    teeth = job.process.tool.teeth
    if not teeth:
        return np.zeros(len(job))
    force = cutting_force(job.process)
    try:
        lowest = float(
            np.min(
                natural_frequencies(
                    job.machine, job.position[:1], modes=1, rotation=job.rotation[:1]
                ).frequency
            )
        )
    except StiffmapError:
        lowest = 0.0
    if not lowest > SLOW * teeth * force.spindle_frequency:
        return np.full(len(job), np.nan)
    amplitude = np.einsum("i,mij->mj", force.amplitude[teeth - 1], np.abs(job.axes))
    return np.asarray(np.abs(np.einsum("mi,mij,mj->m", job.off, state.compliance, amplitude)))


STEPS = 40
DONE = 1e-11
"""m: distance from the path below which a command stands."""


@dataclass(frozen=True, eq=False)
class Commanded:
    """m points, base axes, m."""

    position: Floats
    """(m, 3) to command; NaN where the machine has no answer."""
    left: Floats
    """(m,) m: how far the model still is from the path there, under the force of the wanted cut."""
    mirror: Floats
    """(m, 3) the mirrored commands: the wanted position less the error."""


def commanded(plant: Plant, before: Equilibrium) -> Commanded:
    """Inverse of the loaded machine: on the path the cut is the wanted one, so that its force is known there."""
    job = plant.job
    force = job.force(np.zeros((len(job), 2)))
    steered = np.array([1.0 if axis in job.machine.description.task else 0.0 for axis in "xyz"])
    # the machine's tangent tells where the tool would stand under the wanted cut
    further = np.einsum("mij,mj->mi", before.compliance, force - before.force)
    u = job.position - steered * (np.nan_to_num(before.error) + np.nan_to_num(further))
    rest = np.full((len(job), 3), np.nan)
    active = np.arange(len(job))
    for _ in range(STEPS):
        s = plant.stand(u[active], force[active], rows=active)
        rest[active] = u[active] + s.moved - job.position[active]
        far = np.abs(steered * rest[active]).max(axis=1)
        go = far > DONE  # a lost point compares false
        u[active[go]] -= steered * rest[active[go]]
        active = active[go]
        if not active.size:
            break
    u[~np.isfinite(rest).all(axis=1)] = np.nan
    return Commanded(u, np.linalg.norm(rest, axis=1), job.position - steered * before.error)
