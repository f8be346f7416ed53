"""The whole answer: the part as it will be, commands that make it right, and what they leave."""

from __future__ import annotations

from dataclasses import dataclass, replace
from os import PathLike
from typing import Any

import numpy as np
import xarray as xr

from stiffmap.common.broadcasting import Floats, whole_number
from stiffmap.common.errors import StiffmapError
from stiffmap.machining.milling.choices import Choices, choices
from stiffmap.machining.milling.dataset import along, dataset_of, verdict
from stiffmap.machining.milling.equilibrium import Equilibrium, Plant, commanded, equilibrium
from stiffmap.machining.milling.limits import Warned, must_reach, warned
from stiffmap.machining.milling.program import WITHIN, Program, Run, program, run
from stiffmap.machining.milling.setting import Setting
from stiffmap.machining.milling.speed import Feeds, PathStability, best_feeds, path_stability
from stiffmap.machining.process.force import cutting_force
from stiffmap.machining.process.load import GivenProcess
from stiffmap.machining.toolpath import Toolpath
from stiffmap.machining.toolpath.engagement import within_tool
from stiffmap.solve.machine import Machine, as_machine
from stiffmap.solve.options import keywords_of
from stiffmap.solve.status import Status
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
    feeds: Feeds | None = None
    warnings: tuple[Warned, ...] = ()
    """What is to be watched, and at which points."""
    choices: Choices | None = None
    """Placement, entry and turns of the tool that were asked for."""

    @property
    def finding(self) -> bool:
        """Whether a point has no equilibrium, is beyond the tolerance after compensation, or breaks a limit."""
        t = self.job.process.tolerance
        beyond = t is not None and not (np.abs(self.dataset.error_normal_after.values) <= t).all()
        states = self.dataset.status.values
        return bool((states != Status.CONVERGED).any() or beyond or any(w.finding for w in self.warnings))


@keywords_of(choices)
def mill_job(
    machine: Machine,
    path: Toolpath | str | PathLike[str],
    process: GivenProcess,
    *,
    true_machine: Machine | str | PathLike[str] | None = None,
    step: float = 2e-3,
    within: float = WITHIN,
    thickness: float | None = None,
    passes: int = 1,
    band: bool = False,
    feeds: bool = False,
    threads: int | None = None,
    **chosen: Any,
) -> Milled:
    """The same with the program and all states, for reports."""
    whole_number(passes, "passes", 1)
    made_of = choices(machine, path, process, step=step, thickness=thickness, threads=threads, **chosen)
    job = made_of.job
    within_tool(within, "within", job.process)
    must_reach(job)
    best = best_feeds(job) if feeds else None
    if best is not None:
        job = job.fed(best.feed)
    plant = Plant(job)
    before = equilibrium(plant, job.position)
    command, left, mirror = commanded(plant, before)
    goals = np.where(np.isfinite(command), command, job.position)
    made = program(job, goals, within, None if best is None else best.feed)
    after = run(job, made, step=step)
    mirrored = equilibrium(plant, np.where(np.isfinite(mirror), mirror, job.position))
    ds = dataset_of(job, before, command, left, after, mirrored)
    ds["ripple"] = ("point", ripple(job, before))
    if passes > 1:
        ds["error_normal_passes"] = (("passes", "point"), after_passes(job, before, passes))
    if band:
        for name, share in (("low", 1 - BAND), ("high", 1 + BAND)):
            again = run(replace(job, scale=share * job.scale), made, step=step)
            ds[f"error_normal_after_{name}"] = along(job, again)
    stability = path_stability(job)
    if isinstance(stability, PathStability):
        ds["multiplier"] = ("point", np.interp(job.points.way, stability.way, stability.multiplier))
        ds["multiplier"].attrs["said"] = stability.sentence(job.process.spindle)
    ds.attrs |= {"program": made.text, "verdict": verdict(ds)}
    if made_of.placement is not None:
        ds.attrs["placement"] = made_of.placement.words(job.process.tolerance)
    if made_of.entry is not None:
        ds.attrs["entry"] = made_of.entry.way
    warnings = warned(job, ds)
    if true_machine is not None:
        true_machine = as_machine(true_machine)
        if true_machine.actuators != machine.actuators:
            raise StiffmapError(
                f"true_machine: expected the actuators {', '.join(machine.actuators)}, "
                f"got {', '.join(true_machine.actuators)}"
            )
        real = equilibrium(Plant(job, true_machine), job.position)
        ds["true_error_normal"] = ("point", job.across(real.error))
        ds["true_error_normal_after"] = along(job, run(job, made, true_machine, step=step))
    return Milled(job, before, command, made, after, ds, stability, best, warnings, made_of)


@keywords_of(mill_job)
def mill(
    machine: Machine | str | PathLike[str],
    path: Toolpath | str | PathLike[str],
    process: GivenProcess,
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
        Machine (name, file) that the commands are also simulated on, as an experiment would find it.
    step, within
        m: distance of the points along the path; chord error of the written program.
    stock, thickness
        Box of stock, lowest and highest corner (2, 3) m in the axes of the part, or width to trim, m; None: the process's own cut.
    passes
        Number of passes along the same commands; each further one cuts what the last left (spring-back).
    band
        True: also under 80 and 120 % of the force.
    angle
        (points,) rad: turn of an arm's tool about its axis, from `redundancy`; None: that of the path (C), else as at home.
    feeds
        True: the largest feed of each move at which the error stays within the tolerance; the program has them.
    size, offset
        Of a built-in outline, m; work offsets of G-code by name, as {"G55": (0.01, 0, 0)}, m.
    tolerance
        m; None: the process's.
    place
        So many placements are tried first and the best is taken, refined; instead of `at` and `turn`.
    reverse
        True: the path the other way, conventional for climb and the other way round.
    entry
        Where a closed outline is entered: m along it, or 'best' (the least step).
    redundancy
        Arms: the turn about the tool is chosen from so many over a full turn; instead of `angle`.
    threads
        None: all cores that this process may use.
    scheduler
        Address or client of a dask cluster whose workers try the placements and the turns.
    progress
        Called with the number of lines read of a long program.

    Returns
    -------
    Dataset
        Dimension point (along the path, each cut with both ends): `way` m, `wanted`, `command` (…, 3) m in base axes;
        `error` (…, 3) m before, its parts `error_normal` (positive: material stays on the part), `error_along`, `error_axial`;
        `error_normal_after` of the written program as simulated, at the same way; `mirror_left` what one mirror step leaves;
        `force` (…, 3) N, `gain` kp/k, `effort` N, N·m, `margin` m, `status`, `flags`, `ripple` m; `taper` m, how much
        further out the wall is at the top of the cut than at the tip; `warnings`, a bit for each of its attribute `names`;
        `angle` rad where the tool was turned. Attributes: `program`, the text of the compensated program, `verdict`, `at` m and
        `turn` rad; where asked for `placement`, a sentence, and `entry` m.

    Raises
    ------
    StiffmapError
        For bad input: paths that leave the workspace, cuts with the spindle off ….
    """
    return mill_job(as_machine(machine), path, process, **options).dataset


def after_passes(job: Setting, first: Equilibrium, passes: int) -> Floats:
    """(passes, m) m: height of the wall over the wanted one after each pass; never below what a pass before it took."""
    wall = job.across(first.error)
    out = [wall]
    for _ in range(passes - 1):
        radial = np.maximum(np.nan_to_num(wall), 0.0)
        rest = replace(job, engaged=replace(job.engaged, radial=radial, corner=0 * job.engaged.corner))
        wall = np.minimum(wall, job.across(equilibrium(Plant(rest), job.position).error))
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
        modes = natural_frequencies(job.machine, job.position[:1], modes=1, rotation=job.rotation[:1])
        lowest = float(np.min(modes.frequency))
    except StiffmapError:
        lowest = 0.0
    if not lowest > SLOW * teeth * force.spindle_frequency:
        return np.full(len(job), np.nan)
    line = 2 * np.fft.rfft(force.force, axis=0)[teeth] / len(force.angle)  # with the phases between the axes
    return np.asarray(np.abs(np.einsum("mi,mij,mkj,k->m", job.off, state.compliance, job.axes, line)))
