"""`diagnose`: from readings to a verdict."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from os import PathLike
from typing import Any

import numpy as np
from scipy.stats import chi2

from stiffmap.common.broadcasting import whole_number
from stiffmap.common.number_text import within
from stiffmap.common.one_thread import on_one_thread
from stiffmap.experiment.comparison.limitations import limitations, refuse
from stiffmap.experiment.comparison.summary import Summary, summary
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.files.load import load_experiment
from stiffmap.experiment.noise.checks import checks
from stiffmap.experiment.noise.level import Mask
from stiffmap.experiment.noise.over_time import over_time
from stiffmap.experiment.noise.whitening import Problem, nuisance_part
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.calibration import GROUPS, Tolerances, certified
from stiffmap.identification.diagnosis.candidates.candidates import check_kinds
from stiffmap.identification.diagnosis.clock import Clock, Progress
from stiffmap.identification.diagnosis.decision.beside_calibration import Answer, find_effects
from stiffmap.identification.diagnosis.decision.beside_noise import noise_left
from stiffmap.identification.diagnosis.decision.cross_validation import HeldOut, held_out
from stiffmap.identification.diagnosis.decision.empirical import empirical
from stiffmap.identification.diagnosis.decision.judge import after_checks
from stiffmap.identification.diagnosis.decision.largest_residual import located
from stiffmap.identification.diagnosis.decision.result_machine import result_machine
from stiffmap.identification.diagnosis.decision.stability import explained
from stiffmap.identification.diagnosis.fitting.model import Model
from stiffmap.identification.diagnosis.report.describe import aliases_of, as_place, named_effects
from stiffmap.identification.diagnosis.report.findings import Detectability, Effect, NoiseReport
from stiffmap.identification.diagnosis.report.result import Diagnosis
from stiffmap.identification.diagnosis.rivals.explain import Explanation, explain
from stiffmap.identification.diagnosis.rivals.separation import separation
from stiffmap.identification.diagnosis.search.detectability import detectable
from stiffmap.identification.diagnosis.search.study import Finding, Study, study
from stiffmap.identification.diagnosis.slips.factors import named_within
from stiffmap.identification.diagnosis.slips.find import find_slip
from stiffmap.identification.diagnosis.slips.slip import Slip
from stiffmap.solve.machine import Machine, load_machine

SLIPS = 2
"""Mistakes in the readings that are undone one after the other."""
GAINS = ("load_gain", "sensor_gain")
LISTED = 20
"""Patterns that a verdict lists at most."""


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
    scheduler: Any = None,
) -> Diagnosis:
    """Which physical effect the declared machine lacks, where, how large, and how sure that is.

    Parameters
    ----------
    machine
        Declared machine, the name of a shipped one, or a machine file.
    experiment
        An experiment, its folder or its YAML file.
    seed
        Of the simulated noise and of the folds; the same seed gives the same answer.
    threads
        None: all cores that this process may use.
    cross_validate
        False leaves out the nested cross-validation: `before` and `after` are then not held out.
    tolerances
        Standard uncertainties of what the machine file declares, where it gives none: effects are named
        only jointly with them (docs/calibration.md).
    exclude
        Kinds of effects, or groups of the calibration, that are known not to be.
    time_limit
        Seconds after which no new step begins; the answer is then the best so far, `stopped` is set, and so it
        is after Ctrl-C, also among the sensitivities (`not_tried` lists the effects that have none). None: a bound on what is tried instead, the same on every computer, which readings that
        nothing explains reach; `not_tried` then says what was left out.
    progress
        Called with a text on what is tried.
    scheduler
        Address of a dask scheduler, or a `distributed.Client`: its workers do the bootstrap of the search, with the same answer.

    Raises
    ------
    StiffmapError
        For files that cannot be used, poses out of reach, and noise that is unknown. docs/diagnosis.md
        describes the method.
    """
    whole_number(seed, "seed", 0)
    machine = machine if isinstance(machine, Machine) else load_machine(machine)
    data = experiment if isinstance(experiment, Experiment) else load_experiment(experiment)
    clock = Clock.of(time_limit, progress)
    groups = tuple(n for n in exclude if n in GROUPS)
    without = check_kinds(n for n in exclude if n not in GROUPS)
    with clock.on_interrupt():
        predictor = Predictor(machine, data, threads=threads)
        refuse(predictor.experiment, predictor())
        s, slips = without_slips(study(predictor, seed, None, clock, without, scheduler), seed)
        if time_limit is None:
            clock.bound(s.predictor)
        answer = _diagnosed(s, seed, certified(tolerances, data), groups, cross_validate)
        return with_slips(answer, slips) if slips else answer


def without_slips(s: Study, seed: int) -> tuple[Study, list[Slip]]:
    """The study of the readings with mistakes of writing and mounting undone, and what they are."""
    slips: list[Slip] = []
    s.clock.say("units, signs, swaps and shifted rows")
    while len(slips) < SLIPS and not s.clock.over and (found := find_slip(s)):
        slips.append(found.slip)
        if not found.slip.undone:
            break
        predictor = Predictor(s.predictor.machine, found.experiment, threads=s.predictor.threads)
        refuse(predictor.experiment, predictor())
        s = study(predictor, seed, None, s.clock, s.without, s.scheduler)
    return s, slips


def with_slips(d: Diagnosis, slips: Sequence[Slip]) -> Diagnosis:
    """The answer that names mistakes in the readings before any cause."""
    return replace(d, slips=[by_gain(s, d.effects) for s in slips], verdict="readings")


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
    return replace(s, check=f"check first: {', or '.join(names)}", seen=seen)


def _diagnosed(
    s: Study, seed: int, tolerances: Tolerances, groups: tuple[str, ...], cross_validate: bool
) -> Diagnosis:
    times = [time.perf_counter()]
    found = find_effects(s, seed, tolerances, groups)
    times.append(time.perf_counter())
    held = found.held
    if held is None and cross_validate:
        held = held_out(found.study, found.finding.outliers, seed, found.finding)
    times.append(time.perf_counter())
    answer = _assemble(found, held, seed)
    times.append(time.perf_counter())
    steps = ("search", "cross-validation", "rivals and intervals")
    answer.seconds.update(s.seconds, **dict(zip(steps, np.diff(times).tolist(), strict=True)))
    return answer


def _assemble(found: Answer, held: HeldOut | None, seed: int) -> Diagnosis:
    s, finding, verdict, left = found.study, found.finding, found.verdict, found.left
    e, search = s.experiment, finding.search
    s.clock.say("rivals and intervals")
    why = Explanation(finding.model) if s.clock.over else explain(s, search, finding.model)
    model, other = why.model, why.others
    finding = replace(finding, selection=replace(finding.selection, model=model))
    before = s.free(s.reading - s.plan.base, finding.outliers, calibrated=False)
    made = s.corrected(model, ~finding.outliers)
    left_over = s.reading - made.prediction
    exact = Problem.of(e, s.noise.sigma, made.prediction, ~finding.outliers)
    after = left_over - nuisance_part(exact, left_over)
    if other and verdict == "effects":
        verdict = "ambiguous"
    noise = noise_left(finding, model)
    inflation = max(1.0, noise.widening) if left else noise.widening
    keep = ~finding.outliers
    as_declared = verdict == "unattributed" and s.layer is None  # what the folds found is not in the machine
    sums = _summaries(None if as_declared else held, before, after, s, keep)
    return Diagnosis(
        verdict=verdict,
        effects=_effects(s, finding, why, inflation),
        alternatives=[named_effects(s, search, m, inflation) for m in other],
        separations=[separation(s, model, m, seed) for m in other],
        before=sums[0],
        after=sums[1],
        held_out=held,
        noise=_noise(s, finding),
        detectable=_detectable(s, finding),
        unobservable=_unobservable(s, finding),
        outliers=[e.ids[i] for i in np.flatnonzero(finding.outliers)],
        checks_before=checks(e, e.reading, s.noise.sigma, keep),
        checks_after=after_checks(s, finding),
        unexplained=[
            located(p, e, np.where(keep[:, None], after, np.nan), s.noise.sigma) for p in left[:LISTED]
        ],
        limitations=[
            *found.notes,
            *limitations(e, s.noise, s.predictor.machine),
            *([] if left else noise.sentences()),
            *_over_time(finding, model),
        ],
        significance={
            "effective_trials": s.effective_trials,
            "alpha": search.alpha,
            "needed_minus_ln_p": search.threshold,
        },
        machine=result_machine(s, model, made.machine, keep, None if as_declared else held),
        declared=s.predictor.machine,
        experiment=e,
        residual_before=before,
        residual_after=after,
        set_aside=finding.outliers,
        empirical=empirical(e, np.where(keep[:, None], after, np.nan), s.noise.sigma, seed) if left else None,
        calibration=found.calibration,
        refused=list(found.refused),
        stopped=s.clock.stopped or bool(s.clock.left_out),
        not_tried=list(s.clock.left_out),
        seed=seed,
        explained=explained(finding.selection.null, model, search.problem.freedom)
        if model.candidates
        else 0.0,
    )


def _effects(s: Study, finding: Finding, why: Explanation, inflation: float) -> list[Effect]:
    """The effects that are named, each with what no reading tells from it."""
    return [
        replace(e, aliases=[*e.aliases, *(as_place(a) for own, a, _ in why.aliases if own.place == e.place)])
        for e in named_effects(s, finding.search, finding.model, inflation)
    ]


def _detectable(s: Study, finding: Finding) -> list[Detectability]:
    """How small each effect could be and still be found, in addition to those that are named."""
    search = finding.search
    return [
        Detectability(
            d.candidate.kind,
            d.candidate.element,
            d.candidate.legs,
            d.sizes,
            aliases_of(s.classes, d.candidate),
        )
        for d in detectable(search.screen.beside(finding.model.tangent()), search.threshold)
        if any(v is not None for v in d.sizes.values())
    ]


def _over_time(finding: Finding, model: Model) -> list[str]:
    """What the model leaves over time, in words; nothing where no times were recorded."""
    assert model.residual is not None
    found = over_time(finding.search.problem, model.residual)
    return [] if found is None else [str(found)]


def _summaries(
    held: HeldOut | None, before: Floats, after: Floats, s: Study, keep: Mask
) -> tuple[Summary, Summary]:
    if held:
        return held.before, held.after
    rows = keep[:, None]
    return tuple(
        summary(np.where(rows, r, np.nan), s.noise.sigma, s.experiment.channels) for r in (before, after)
    )  # type: ignore[return-value]


def _noise(s: Study, finding: Finding) -> NoiseReport:
    problem, n = finding.search.problem, s.noise

    def per_axis(values: Floats) -> dict[str, float]:
        read = zip(s.experiment.channels, values, s.experiment.axis_read, strict=True)
        return {c.name: float(v) for c, v, r in read if r}

    before = float(chi2.sf(finding.selection.null.chi2, problem.freedom))
    after = float(chi2.sf(finding.model.chi2, max(1, problem.freedom - finding.model.freedom)))
    return NoiseReport(
        per_axis(n.floor),
        per_axis(n.repeats),
        per_axis(n.declared),
        per_axis(n.consistency),
        before,
        after,
        n.rms,
    )


def _unobservable(s: Study, finding: Finding) -> list[str]:
    seen = {c.representative for c in s.classes} | {m for c in s.classes for m in c.members}
    all_ = {id(v.candidate): v.candidate for v in s.plan.variants}.values()
    failed = [f"{c} ({why})" for c, why in s.plan.failed]
    tried = [f"{c} (fit failed: {why})" for c, why in finding.search.failed.items()]
    return [str(c) for c in all_ if c not in seen] + failed + tried
