"""`calibrate`: every uncertain number of a machine from readings, at once."""

from __future__ import annotations

import time
from collections.abc import Sequence
from os import PathLike

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpstrf

from stiffmap.common.broadcasting import names_of, whole_number
from stiffmap.common.errors import StiffmapError
from stiffmap.common.tasks import on_one_thread
from stiffmap.experiment.calls import as_experiment
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.noise.outliers import swapped
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.calibration.result import Calibration, FoundNumber
from stiffmap.identification.candidates.sensitivity import CandidatePlan
from stiffmap.identification.clock import Clock, Progress
from stiffmap.identification.inference.amplitudes import Fit
from stiffmap.identification.inference.columns import Columns
from stiffmap.identification.inference.constants import ODDS
from stiffmap.identification.inference.corrected import Corrected, corrected
from stiffmap.identification.inference.machines import CALIBRATED, DECLARED, vouched, written
from stiffmap.identification.inference.names import Inferred, infer
from stiffmap.identification.inference.readings import readings
from stiffmap.identification.inference.shares import of_numbers, shares, tolerance_word, too_wide
from stiffmap.identification.inference.verdict import judged
from stiffmap.identification.inference.world import EXACT
from stiffmap.identification.numbers import GROUPS, Tolerances
from stiffmap.identification.numbers.registration import registered
from stiffmap.identification.validity import covered
from stiffmap.solve.machine import Machine, as_machine

SEEN = 1.0
"""Singular value, per standard uncertainty, beyond which the readings determine a direction more than its prior does."""


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
    exclude = names_of(exclude, "exclude")
    for name in exclude:
        if name not in GROUPS:
            raise StiffmapError(f"calibration: unknown group '{name}'; there are: {', '.join(GROUPS)}")
    clock, start = Clock.of(time_limit, progress), time.perf_counter()
    with clock.on_interrupt():
        predictor = registered(Predictor(declared, data, threads=threads), tolerances, exclude)
        without_effects = CandidatePlan(predictor(), (), ())
        found = infer(predictor, without_effects, tolerances, exclude, clock, seed, travel=True)
        return _answer(predictor, found, clock, seed, start)


def _answer(predictor: Predictor, found: Inferred, clock: Clock, seed: int, start: float) -> Calibration:
    e, columns, best = predictor.experiment, found.columns, found.search.best
    exact = best.score - found.search.exact < np.log(ODDS)
    fit = best.fit if best.world == EXACT else found.search.calibrated or best.fit
    clock.say("calibrated machine")
    given = readings(predictor, found, fit)
    at = corrected(given, ()) if given.drives or (len(given.spread) and not exact) else None
    models = {CALIBRATED: at} if at else {}
    clock.say("readings that no fit saw")
    made = written(models, predictor, found, seed, lambda: clock.over, plain=not exact)
    listed, at = made.listed, made.best or at
    rows, rank = table_of(columns, found.search.calibrated or fit, at)
    verdict = judged(columns, found.search)
    wide = too_wide(fit, verdict.out_of_tolerance)
    at_name = {r.name: r for r in rows}
    beyond = tuple(at_name[b.unknown.name] for b in verdict.beyond)
    held, rest = made.held_out, verdict.rest or verdict.time
    unseen = (held.before, held.after) if held else made.sizes
    first, last = (s.ratio**2 - best.fit.noise**2 for s in unseen)
    unattributed = rest and last > 0.5 * first  # more is left than taken away
    if beyond or not (unattributed or exact):
        word = tolerance_word(", ".join(r.name for r in beyond), wide)
    else:
        word = "unattributed" if unattributed else "as declared"
    return Calibration(
        verdict=word,
        rows=rows,
        rank=rank,
        beyond=beyond,
        wide=wide,
        which=DECLARED if made.which == DECLARED else CALIBRATED,
        before=made.sizes[0],
        after=made.sizes[1],
        held_out=held,
        promise=made.promise,
        noise=found.noise.rms,
        scale=best.fit.noise,
        shares=shares(columns, best.fit),
        rest=rest,
        profiles=at.profiles if at and made.which != DECLARED else (),
        outliers=tuple(e.ids[i] for i in np.flatnonzero(listed)),
        swapped=tuple((e.ids[i], e.ids[j]) for i, j in swapped(e, made.left[1], found.noise.sigma, listed)),
        failed=given.sensitivity.failed,
        stopped=clock.stopped,
        machine=vouched(predictor, made, f"Numbers calibrated by experiment {e.name}."),
        validity=covered(predictor.machine, e, ~listed),
        over_time=made.over_time,
        experiment=e,
        residual=np.where(listed[:, None], np.nan, made.left[1]),
        seconds=time.perf_counter() - start,
    )


def table_of(columns: Columns, fit: Fit, best: Corrected | None) -> tuple[tuple[FoundNumber, ...], int]:
    """Rows of all numbers that the readings show, with their values at the optimum, and how many directions the readings
    determine."""
    found = zip(best.given.sensitivity.unknowns, best.numbers, strict=True) if best else ()
    at = {u.name: float(v) for u, v in found}
    numbers = [p.name for p in fit.parts if p.kind == "number"]
    white = fit.without(numbers).white(columns.numbers)
    gram = white.T @ white
    minimal = set(independent(gram))
    prior = np.ones(len(columns.unknowns))
    for group, index in columns.groups.items():
        # a group that is off by little here has no better tolerances for it
        prior[index] = max(1.0, fit.spread(group))
    spread = np.sqrt(np.diag(np.linalg.inv(np.diag(prior**-2) + gram)))
    out = []
    for k, (u, (value, _, share)) in enumerate(zip(columns.unknowns, of_numbers(columns, fit), strict=True)):
        value, sd = at.get(u.name, value), float(spread[k])
        informed = 1.0 - (sd / prior[k]) ** 2
        pull = float(value / np.sqrt(informed)) if informed > 1e-9 else 0.0
        more = bool(informed > 0.5), float(prior[k] / sd), k in minimal
        own = value * u.u, u.u, sd * u.u, pull
        out.append(FoundNumber(u.name, u.group, u.leg, u.unit, *own, *more, share))
    return tuple(out), int((np.linalg.eigvalsh(gram) > SEEN**2).sum())


def independent(gram: Floats) -> NDArray[np.intp]:
    """A minimal set of unknowns that spans what the readings determine.

    Pivoted elimination of AᵀA: the unknown that is most observable comes first and is projected out of the others, until what
    remains of each is below `SEEN`.
    """
    if not (np.diag(gram) > SEEN**2).any():
        return np.zeros(0, np.intp)
    _, pivots, rank, _ = dpstrf(gram, tol=SEEN**2)
    return np.sort(pivots[:rank]).astype(np.intp) - 1
