"""`diagnose`: from readings to a verdict."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from os import PathLike

from stiffmap.common.broadcasting import names_of, whole_number
from stiffmap.common.number_text import within
from stiffmap.common.tasks import on_one_thread
from stiffmap.experiment.calls import as_experiment
from stiffmap.experiment.experiment import Experiment
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.candidates.sensitivity import plan_of
from stiffmap.identification.clock import Clock, Progress
from stiffmap.identification.diagnosis.answer import answer
from stiffmap.identification.diagnosis.report.findings import Effect
from stiffmap.identification.diagnosis.report.result import Diagnosis
from stiffmap.identification.diagnosis.slips.axes import Slip
from stiffmap.identification.diagnosis.slips.factors import named_within
from stiffmap.identification.diagnosis.slips.find import find_slip
from stiffmap.identification.inference.names import infer
from stiffmap.identification.numbers import GROUPS, Tolerances
from stiffmap.identification.numbers.registration import registered
from stiffmap.model.effects import get
from stiffmap.solve.machine import Machine, as_machine

SLIPS = 2
"""Mistakes in the readings that are undone one after the other."""
GAINS = ("load_gain", "sensor_gain")


@on_one_thread
def diagnose(
    machine: Machine | str | PathLike[str],
    experiment: Experiment | str | PathLike[str],
    *,
    seed: int = 0,
    threads: int | None = None,
    cross_validate: bool = True,
    tolerances: Tolerances | None = None,
    exclude: Sequence[str] = (),
    time_limit: float | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """Which physical effect the declared machine lacks, where, how large, and how sure that is.

    Parameters
    ----------
    machine
        Declared machine, the name of a shipped one, or a machine file.
    experiment
        An experiment, its folder or its YAML file.
    seed
        Of the folds, and of the poses that are drawn of many; the same seed gives the same answer.
    threads
        None: all cores that this process may use.
    cross_validate
        False leaves out the folds: `before` and `after` are then not held out.
    tolerances
        Standard uncertainties of what the machine file declares, where it gives none (docs/calibration.md).
    exclude
        Kinds of effects, or groups of declared numbers, that are known not to be.
    time_limit
        Seconds after which no new step begins; the answer is then the best so far, `stopped` is set, and so it
        is after Ctrl-C, also among the sensitivities (`not_tried` lists the effects that have none).
    progress
        Called with a text on what is tried.

    Raises
    ------
    StiffmapError
        For files that cannot be used, poses out of reach, and noise that is unknown. docs/diagnosis.md
        describes the method.
    """
    whole_number(seed, "seed", 0)
    declared, data = as_machine(machine), as_experiment(experiment)
    clock = Clock.of(time_limit, progress)
    exclude = names_of(exclude, "exclude")
    for name in exclude:
        if name not in GROUPS:
            get(name)
    with clock.on_interrupt():
        times = [time.perf_counter()]
        slips: list[Slip] = []
        while True:
            predictor = registered(Predictor(declared, data, threads=threads), tolerances, exclude)
            plan = plan_of(predictor, clock)
            clock.say("units, signs, swaps and shifted rows")
            found = find_slip(predictor, plan) if len(slips) < SLIPS and not clock.over else None
            if found is None:
                break
            slip, data = found
            slips.append(slip)
            if not slip.undone:
                break
        times.append(time.perf_counter())
        inferred = infer(predictor, plan, tolerances, exclude, clock, seed)
        times.append(time.perf_counter())
        d = answer(predictor, inferred, clock, seed, cross_validate)
    steps = ("sensitivities and slips", "search", "machines and folds")
    times.append(time.perf_counter())
    seconds = {s: b - a for s, a, b in zip(steps, times, times[1:], strict=False)}
    named = [by_gain(s, d.effects) for s in slips]
    return replace(d, seconds=seconds, slips=named, verdict="readings" if named else d.verdict)


def by_gain(s: Slip, effects: Sequence[Effect]) -> Slip:
    """A common factor that no known one is, named by the gain that the diagnosis found jointly with a part of the machine."""
    gains = [e.parameters["gain"] for e in effects if e.kind in GAINS and "gain" in e.parameters]
    if s.kind != "factor" or s.undone or len(gains) != 1:
        return s
    value, low, high, _ = gains[0]
    names = named_within(low, high)
    if not names:
        return s
    seen = (
        f"{s.seen}, {within(value, (high - low) / 3.92)} times jointly with the cause that is found as well"
    )
    return replace(s, check=f"check first: {', '.join(names)}", seen=seen)
