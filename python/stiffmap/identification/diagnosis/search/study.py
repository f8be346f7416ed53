"""One pass of finding effects in some rows of an experiment, outliers included."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.noise.level import Mask, Noise, noise_of
from stiffmap.experiment.noise.outliers import outliers, suspects
from stiffmap.experiment.noise.whitening import Problem, nuisance_part
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.calibration.corrected import Corrected
from stiffmap.identification.diagnosis.candidates.plan import Plan, plan_of
from stiffmap.identification.diagnosis.clock import Clock
from stiffmap.identification.diagnosis.fitting.model import Model
from stiffmap.identification.diagnosis.search.alias import AliasClass, alias_classes
from stiffmap.identification.diagnosis.search.calibrated import Layer
from stiffmap.identification.diagnosis.search.screen import Screen
from stiffmap.identification.diagnosis.search.selection import Search, Selection, select
from stiffmap.identification.diagnosis.search.significance import (
    ENOUGH,
    FEWER,
    effective_number_of_trials,
    on_enough_rows,
)
from stiffmap.model.description import MachineDescription


@dataclass(frozen=True, eq=False)
class Study:
    """What all passes over an experiment share: plan, noise, alias classes, the worth of a search."""

    predictor: Predictor
    plan: Plan
    noise: Noise
    classes: tuple[AliasClass, ...]
    effective_trials: float
    whole: tuple[Problem, Screen]
    """All rows, and the representatives on them."""
    layer: Layer | None = None
    """Calibration below the effects; None: the declared numbers are taken as exact."""
    clock: Clock = field(default_factory=Clock)
    without: frozenset[str] = frozenset()
    """Kinds of effects that are not tried."""
    seconds: dict[str, float] = field(default_factory=dict)
    """What the sensitivities and the bootstrap of the search took; nothing where they were known."""
    scheduler: Any = None
    """Of a dask cluster, whose workers do the bootstrap."""

    def free(
        self, residual: Floats, out: Mask, train: Mask | None = None, *, calibrated: bool = True
    ) -> Floats:
        """(n, c) residual less the calibration that fits its rows in `train` best (default: those outside
        `out`), unless not `calibrated`, and less the unknown frames and zeros that fit those outside `out`.

        Nuisances are taken from all rows, held out or not: an instrument that was set up anew has a frame
        of its own, which no other set-up tells; so with zeros that a set-up has for itself.
        """
        problem = self.problem_of(~out) if out.any() else self.whole[0]
        if self.layer is not None and calibrated:
            told = problem if train is None else self.problem_of(train & ~out)
            residual = residual - self.layer.part(told, residual)
            if train is not None and self.layer.own and (~train & ~out).any():
                rest = self.layer.own_part(self.problem_of(~train & ~out), residual)
                residual = residual - np.where(train[:, None], 0.0, rest)
        return np.asarray(residual - nuisance_part(problem, residual))

    def problem_of(self, keep: Mask) -> Problem:
        """The problem of some of the rows."""
        uncertain = None if self.layer is None else self.layer.columns
        return Problem.of(self.experiment, self.noise.sigma, self.plan.base, keep, uncertain)

    @property
    def reading(self) -> Floats:
        """(n, c) as read, without what a calibration below the effects takes out of the readings."""
        if self.layer is None:
            return self.experiment.reading
        return self.layer.calibration.experiment.reading

    def corrected(self, model: Model, keep: Mask) -> Corrected:
        """The machine with the effects of a model, and the calibration by the rows in `keep` (n,) below them."""
        terms = model.terms()
        if self.layer is not None:
            return self.layer.calibration.correction.of(keep, terms)
        return Corrected(self.predictor.with_terms(terms), np.zeros(0), self.predictor(terms))

    @property
    def experiment(self) -> Experiment:
        """The experiment; above a calibration its readings are less what is not linear in the uncertain numbers."""
        return self.predictor.experiment

    @property
    def description(self) -> MachineDescription:
        """The declared machine."""
        return self.predictor.machine.description


@dataclass(frozen=True, eq=False)
class Finding:
    """Result of a pass: the selection, the search behind it, and the outliers."""

    selection: Selection
    search: Search
    outliers: Mask

    @property
    def model(self) -> Model:
        """The effects found."""
        return self.selection.model


TYPICAL = 1.2
"""Robust spread of residuals, in noise floors, that still counts as a model that fits."""

_TRIALS: dict[tuple[str, int, bytes], float] = {}


def study(
    predictor: Predictor,
    seed: int,
    layer: Layer | None = None,
    clock: Clock | None = None,
    without: frozenset[str] = frozenset(),
    scheduler: Any = None,
) -> Study:
    """Prepare: sensitivities, noise floor without suspects, alias classes, null search.

    layer
        Calibration below the effects: its uncertain numbers are integrated out of everything.
    without
        Kinds of effects that are not tried.
    scheduler
        Of a dask cluster, whose workers do the bootstrap of the search.
    """
    start = time.perf_counter()
    if clock is not None:
        clock.say("sensitivities of all candidates")
    plan = plan_of(predictor, clock)
    if without:
        kept = np.flatnonzero([v.candidate.kind not in without for v in plan.variants])
        plan = replace(plan, stack=plan.stack.only(kept), digest=plan.digest + repr(sorted(without)))
    e = predictor.experiment
    rough = noise_of(e)
    raw = e.reading - plan.base
    bare = raw - nuisance_part(Problem.of(e, rough.sigma, plan.base), raw)
    first = noise_of(e, ~suspects(e, bare, rough.sigma)) if layer is None else layer.noise
    problem = Problem.of(e, first.sigma, plan.base, None, None if layer is None else layer.columns)
    screen = Screen.of(problem, plan.stack)
    classes = tuple(alias_classes(screen, predictor.machine.description))
    named = _representatives(screen, classes)
    sizes = np.round(np.log(first.sigma), 2).tobytes()
    key = (plan.digest + ("" if layer is None else layer.digest), seed, sizes)
    prepared = time.perf_counter()
    if key not in _TRIALS:
        if len(problem) > ENOUGH:
            uncertain = None if layer is None else layer.columns
            few = on_enough_rows(problem, named.stack, uncertain, seed)
            _TRIALS[key] = effective_number_of_trials(few, seed, FEWER, scheduler)
        else:
            _TRIALS[key] = effective_number_of_trials(named, seed, scheduler=scheduler)
    seconds = {"sensitivities": prepared - start, "null bootstrap": time.perf_counter() - prepared}
    return Study(
        predictor,
        plan,
        first,
        classes,
        _TRIALS[key],
        (problem, named),
        layer,
        clock or Clock(),
        without,
        seconds,
        scheduler,
    )


def find(study: Study, rows: Mask | None = None, *, finalists: int = 5) -> Finding:
    """Effects in the rows; outliers are judged against the model and re-admitted where it explains them."""
    e = study.experiment
    allowed = np.ones(len(e), bool) if rows is None else rows
    nobody = np.zeros(len(e), bool)
    bare = study.free(e.reading - study.plan.base, nobody, allowed)
    out = suspects(e, bare, study.noise.sigma) & allowed
    if study.layer is not None:  # what a calibrated machine leaves is judged against the model below
        out = study.layer.out & allowed
    for _ in range(1 if study.clock.over else 3):
        search = search_on(study, allowed & ~out, finalists)
        selection = select(search)
        residual = study.free(e.reading - study.predictor(selection.model.terms()), out, allowed)
        again = alone(study, _held(residual, allowed)) & allowed
        if np.array_equal(again, out):
            break
        if study.clock.spent:
            study.clock.leave_out("the search again without the outliers that it found")
            break
        out = again
    else:
        search = search_on(study, allowed & ~out, finalists)
        selection = select(search)
    return Finding(selection, search, out)


def alone(study: Study, residual: Floats) -> Mask:
    """(n,) outliers of residuals (n, c). Where the model does not fit, rows are judged against the typical residual
    instead of the noise floor, so that the misfit makes no outliers."""
    sigma = study.noise.sigma
    seen = np.isfinite(residual).any(axis=0)
    typical = np.ones(sigma.shape[1])
    typical[seen] = 1.4826 * np.nanmedian(np.abs(residual / sigma)[:, seen], axis=0)
    return outliers(study.experiment, residual, sigma * np.maximum(typical / TYPICAL, 1.0))


def _held(residual: Floats, allowed: Mask) -> Floats:
    return np.where(allowed[:, None], residual, np.nan)


def search_on(study: Study, keep: Mask, finalists: int) -> Search:
    """The search on some of the rows."""
    if keep.all():
        return Search(study.predictor, *study.whole, study.effective_trials, finalists, clock=study.clock)
    problem = study.problem_of(keep)
    screen = Screen.of(problem, study.whole[1].stack)
    return Search(study.predictor, problem, screen, study.effective_trials, finalists, clock=study.clock)


def _representatives(screen: Screen, classes: tuple[AliasClass, ...]) -> Screen:
    named = {id(c.representative) for c in classes}
    return screen.only(np.flatnonzero([id(v.candidate) in named for v in screen.variants]))
