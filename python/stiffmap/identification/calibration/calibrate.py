"""`calibrate`: every uncertain number of a machine from readings, at once."""

from __future__ import annotations

import time
from collections.abc import Sequence
from os import PathLike

import numpy as np

from stiffmap.common.broadcasting import whole_number
from stiffmap.common.errors import StiffmapError
from stiffmap.common.one_thread import on_one_thread
from stiffmap.experiment.calls import as_experiment
from stiffmap.experiment.comparison.limitations import refuse
from stiffmap.experiment.comparison.summary import Summary, summary
from stiffmap.experiment.experiment import Experiment
from stiffmap.experiment.noise.outliers import swapped
from stiffmap.experiment.noise.over_time import over_time
from stiffmap.experiment.noise.whitening import Problem
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.calibration.result import Calibration
from stiffmap.identification.calibration.table import table_of, too_wide
from stiffmap.identification.candidates.plan import Plan
from stiffmap.identification.clock import Clock, Progress
from stiffmap.identification.inference.constants import ODDS
from stiffmap.identification.inference.corrected import Corrected, corrected
from stiffmap.identification.inference.inference import Inferred, infer
from stiffmap.identification.inference.machines import (
    CALIBRATED,
    HeldOut,
    left_by,
    stands_out,
    vouched,
    written,
)
from stiffmap.identification.inference.names import EXACT
from stiffmap.identification.inference.readings import readings
from stiffmap.identification.inference.shares import shares
from stiffmap.identification.inference.verdict import judged
from stiffmap.identification.numbers import GROUPS, Tolerances
from stiffmap.identification.validity import covered
from stiffmap.solve.machine import Machine, as_machine


@on_one_thread
def calibrate(
    machine: Machine | str | PathLike[str],
    experiment: Experiment | str | PathLike[str],
    *,
    tolerances: Tolerances | None = None,
    exclude: Sequence[str] = (),
    seed: int = 0,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress | None = None,
) -> Calibration:
    """What a machine's uncertain numbers are, and which of them the readings can determine.

    Parameters
    ----------
    machine
        Declared machine, the name of a shipped one, or a machine file.
    experiment
        An experiment, its folder or its YAML file.
    tolerances
        Standard uncertainties per class where the machine file gives none.
    exclude
        Groups that are left out (`GROUPS`): what is known to be right.
    seed
        Of the folds, and of the poses that are drawn of many.
    time_limit
        Seconds after which no new step begins; the answer is then the best so far, and says so.
    progress
        Called with a text on what is being tried.

    Raises
    ------
    StiffmapError
        For files that cannot be used, poses out of reach, an unknown noise or group.
        docs/calibration.md describes the method.
    """
    whole_number(seed, "seed", 0)
    declared, data = as_machine(machine), as_experiment(experiment)
    for name in exclude:
        if name not in GROUPS:
            raise StiffmapError(f"calibration: unknown group '{name}'; there are: {', '.join(GROUPS)}")
    clock, start = Clock.of(time_limit, progress), time.perf_counter()
    with clock.on_interrupt():
        predictor = Predictor(declared, data, threads=threads)
        refuse(predictor.experiment, predictor())
        without_effects = Plan(predictor(), (), ())
        found = infer(predictor, without_effects, tolerances, exclude, clock, seed, travel=True)
        return _answer(predictor, found, clock, seed, start)


def _answer(predictor: Predictor, found: Inferred, clock: Clock, seed: int, start: float) -> Calibration:
    e, columns, best = predictor.experiment, found.columns, found.search.best
    base, sigma = found.plan.base, found.noise.sigma
    exact = best.score - found.search.exact < np.log(ODDS)
    fit = best.fit if best.world == EXACT else found.search.calibrated or best.fit
    clock.say("calibrated machine")
    given = readings(predictor, found.uncertain, columns, fit, sigma, found.suspects)
    models: dict[str, Corrected] = {}
    if given.drives or (len(given.spread) and not exact):
        models[CALIBRATED] = corrected(given, ())
    listed = stands_out(columns, best.fit, found.suspects, models.values())
    clock.say("readings that no fit saw")
    made = written(models, base, given, listed, seed, lambda: clock.over)
    at = models.get(CALIBRATED)
    whole = [left_by(e, sigma, p, ~listed) for p in (base, made.prediction)]
    left = [np.where(listed[:, None], np.nan, v) for v in whole]
    before, after = (summary(v, sigma, e.channels) for v in left)
    pairs = swapped(e, whole[1], sigma, listed)
    rows, rank = table_of(columns, found.search.calibrated or fit, at)
    verdict, wide = judged(columns, found.search), too_wide(fit)
    at_name = {r.name: r for r in rows}
    beyond = tuple(at_name[b.unknown.name] for b in verdict.beyond)
    each = shares(columns, best.fit)
    problem = Problem.of(e, sigma, made.prediction, ~listed)
    if beyond:
        word = f"beyond tolerance: {', '.join(r.name for r in beyond)}"
    elif (verdict.rest or verdict.time) and _mostly_left(made.held_out, before, after, best.fit.noise):
        word = "unattributed"
    elif exact:
        word = "as declared"
    else:
        word = f"adjusted {'beyond' if wide else 'within'} tolerance"
    return Calibration(
        verdict=word,
        rows=rows,
        rank=rank,
        beyond=beyond,
        wide=wide,
        which=made.which,
        before=before,
        after=after,
        held_out=made.held_out,
        promise=made.promise,
        noise=found.noise.rms,
        scale=best.fit.noise,
        shares=each,
        rest=verdict.rest or verdict.time,
        profiles=at.profiles if at and made.which == CALIBRATED else (),
        outliers=tuple(e.ids[i] for i in np.flatnonzero(listed)),
        swapped=tuple((e.ids[i], e.ids[j]) for i, j in pairs),
        failed=given.sensitivity.failed,
        stopped=clock.stopped,
        machine=vouched(predictor, made, f"Numbers calibrated by experiment {e.name}.", columns, ~listed),
        validity=covered(predictor.machine, e, ~listed),
        over_time=over_time(problem, problem.residual(made.prediction)),
        experiment=e,
        residual=left[1],
        seconds=time.perf_counter() - start,
    )


def _mostly_left(held: HeldOut | None, before: Summary, after: Summary, noise: float) -> bool:
    """Whether of the squares beyond noise more is left than taken away, of readings that no fit saw where there are any."""
    one, other = (held.before, held.after) if held else (before, after)
    return other.ratio**2 - noise**2 > 0.5 * (one.ratio**2 - noise**2)
