"""Planning and monitoring as Python calls, with machines, experiments and effects as they are named elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike

from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import trailing, wrench_array
from stiffmap.common.errors import StiffmapError
from stiffmap.experiment import Experiment
from stiffmap.experiment.calls import Effects, as_experiment, effects_of
from stiffmap.identification.planning.design import Design, design
from stiffmap.identification.planning.monitor import Comparison, compare
from stiffmap.model.files.load import Source
from stiffmap.solve.machine import Machine, as_machine


def plan(
    machine: Machine | Source,
    identify: Effects,
    *,
    rows: int = 12,
    rival: Effects = (),
    aim: str | None = None,
    quantity: str = "deflection",
    poses: int = 60,
    force: float = 400.0,
    candidates: Experiment | str | PathLike[str] | None = None,
    position: ArrayLike | None = None,
    wrench: ArrayLike | None = None,
    frame: str = "known",
    tool: str = "known",
    axes: Sequence[str] = ("dx", "dy", "dz"),
    noise: float | None = None,
    seed: int = 0,
    done: Experiment | str | PathLike[str] | None = None,
) -> Design:
    """Which poses, loads and readings are most informative, before the instrument is booked.

    Parameters
    ----------
    identify
        Effects whose numbers are wanted, at the values given: ``"compliance actuator x scale=1"``, or records.
    rows
        Number of rows to measure.
    rival
        Another explanation, to be distinguished from `identify`.
    aim
        ``identify`` (D-optimal), ``separate`` (needs `rival`), ``map`` (the map at the workpiece); None: ``separate`` where there
        is a rival, else ``identify``.
    position, wrench
        With the aim ``map``: poses of the workpiece (m, 3) m and the wrench (6,) N, N·m there; None: corners of the
        workspace, `force` along x.
    candidates, done
        Rows to choose from, and rows that have been measured: experiments, their folders or files.
    quantity, poses, force, frame, tool, axes, noise, seed
        As in `stiffmap.identification.planning.design.design`: N, m.

    Returns a `Design`: its `experiment` holds the rows, `sigma` (k,) the expected standard uncertainties (SI).
    Raises StiffmapError for bad input.
    """
    m = as_machine(machine)
    terms, others = effects_of(m, identify), effects_of(m, rival)
    if not terms:
        raise StiffmapError("identify: expected at least one effect, got none")
    return design(
        m,
        terms,
        rows=rows,
        aim=("separate" if others else "identify") if aim is None else aim,
        rival=others,
        quantity=quantity,
        poses=poses,
        force=force,
        candidates=None if candidates is None else as_experiment(candidates),
        at=None if position is None else trailing(position, (3,), "position", "positions (m)").reshape(-1, 3),
        load=None if wrench is None else wrench_array(wrench),
        frame=frame,
        tool=tool,
        axes=axes,
        noise=noise,
        seed=seed,
        done=None if done is None else as_experiment(done),
    )


def monitor(
    machine: Machine | Source,
    before: Experiment | str | PathLike[str],
    after: Experiment | str | PathLike[str],
    effects: Effects,
) -> Comparison:
    """What changed between two experiments, or whether two machines of a type share their numbers.

    before, after
        Experiments, their folders or files.
    effects
        What is followed: its numbers are fitted to each experiment on its own.

    Returns a `Comparison`: `changes` in SI with uncertainty and p-value each, `common` where one set of numbers serves both.
    Raises StiffmapError for bad input.
    """
    m = as_machine(machine)
    terms = effects_of(m, effects)
    if not terms:
        raise StiffmapError("effects: expected at least one effect to follow, got none")
    return compare(m, as_experiment(before), as_experiment(after), terms)
