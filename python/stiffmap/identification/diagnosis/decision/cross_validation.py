"""Nested cross-validation by groups: outliers, selection and fit repeated inside every fold."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stiffmap.experiment.comparison.summary import Summary, summary
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.noise.folds import folds
from stiffmap.experiment.noise.level import Mask
from stiffmap.experiment.noise.unseen import left_unseen
from stiffmap.experiment.noise.whitening import basis
from stiffmap.identification.diagnosis.fitting.fit import evaluate, fit
from stiffmap.identification.diagnosis.fitting.model import Model
from stiffmap.identification.diagnosis.search.selection import Search, minus_log_p_of
from stiffmap.identification.diagnosis.search.study import Finding, Study, alone, find, search_on


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Readings that no fit saw."""

    before: Summary
    after: Summary
    residual: Floats
    """(n, c) reading minus what the corrected machine made without the row's group says of it, less unknown frames and
    zeros as the other groups determine them."""
    chosen: dict[str, int]
    """How many of the folds chose each effect."""
    folds: int
    by: str
    """``poses`` or ``set-ups``."""
    calibrated: Summary | None = None
    """With the calibration alone, no effect; None where the declared numbers are taken as exact."""
    gain: tuple[float, float] | None = None
    """What the effects take off the squared residual of the calibration, in noise variances per
    reading: mean over the folds and its standard error."""

    def shared(self, effect: str) -> bool:
        """Whether more than half of the folds chose the effect."""
        return 2 * self.chosen.get(effect, 0) > self.folds

    @property
    def pays(self) -> bool:
        """Whether the effects gain more on held-out readings than one standard error."""
        return self.gain is None or self.gain[0] > self.gain[1]


def held_out(
    study: Study, listed: Mask, seed: int, known: Finding | None = None, *, search: bool = True
) -> HeldOut | None:
    """Residuals before and after on held-out groups; None where there are not two groups.

    Rows in `listed` (outliers of the whole experiment) and rows that the fold's own model finds
    standing alone count neither before nor after. A fold whose rows demand each effect of the `known`
    finding, and no other, is not searched again: the effects' values are fitted to its rows. Without `search` no
    fold has effects.
    """
    e = study.experiment
    label, by = folds(e, seed)
    if label.max() == 0:
        return None
    after = np.full_like(e.reading, np.nan)
    files = Unseen.of(study, listed)
    alone_only = np.full_like(e.reading, np.nan)
    chosen: Counter[str] = Counter()
    for fold in range(int(label.max()) + 1):
        if study.clock.over:
            return None
        study.clock.say(f"held-out fold {fold + 1} of {int(label.max()) + 1}")
        test = label == fold
        model = Model()
        if search:
            model = _kept(study, known, ~test) or find(study, ~test, finalists=3).model
        chosen.update(map(str, model.candidates))
        residual = study.free(e.reading - study.predictor(model.terms()), listed, ~test)
        gone = alone(study, np.where(test[:, None], residual, np.nan)) & listed
        after[test & ~gone] = residual[test & ~gone]
        files.add(model, test, test & ~gone)
        if study.layer is not None:
            bare = study.free(e.reading - study.plan.base, listed, ~test)
            alone_only[test & ~gone] = bare[test & ~gone]
    sigma = study.noise.sigma
    calibrated = gain = None
    if study.layer is not None:
        calibrated = summary(alone_only, sigma, e.channels)
        gain = _gain(alone_only / sigma, after / sigma, label)
    return HeldOut(
        summary(files.before, sigma, e.channels),
        summary(files.after, sigma, e.channels),
        files.after,
        dict(chosen),
        int(label.max()) + 1,
        by,
        calibrated,
        gain,
    )


@dataclass(frozen=True, eq=False)
class Unseen:
    """Residuals (n, c) of the declared and of the corrected machine, each group predicted by all others."""

    study: Study
    listed: Mask
    before: Floats
    after: Floats

    @staticmethod
    def of(study: Study, listed: Mask) -> Unseen:
        """Nothing predicted yet; rows in `listed` (n,) are no readings to fit."""
        nothing = np.full_like(study.experiment.reading, np.nan)
        return Unseen(study, listed, nothing, nothing.copy())

    def add(self, model: Model, test: Mask, rows: Mask) -> None:
        """The `rows` (n,) of one group `test` (n,), predicted by the machine that all others make with the effects of a
        model."""
        s, seen = self.study, ~test & ~self.listed
        e = s.experiment.with_readings(s.reading)
        made = s.corrected(model, seen)
        for out, prediction in ((self.before, s.plan.base), (self.after, made.prediction)):
            out[rows] = left_unseen(e, s.noise.sigma, prediction, seen, test & ~self.listed)[rows]


def _kept(study: Study, known: Finding | None, rows: Mask) -> Model | None:
    """The effects of a finding refitted to some rows; None where these might choose otherwise."""
    if known is None or not known.model.usable:
        return None
    search = search_on(study, rows & ~known.outliers, 3)
    model = known.model
    if model.candidates:
        model = fit(model, search.predictor, search.problem)
        if not model.usable or not _demanded(search, model):
            return None
    else:
        model = evaluate(model, search.predictor, search.problem)
    assert model.residual is not None
    beside = search.screen.beside(model.tangent())
    more = beside.minus_log_p(beside.delta_chi2(model.residual[:, None])[:, 0])
    return model if float(more.max(initial=0.0)) < search.threshold else None


def _demanded(search: Search, model: Model) -> bool:
    """Whether each effect would be missed, to first order."""
    assert model.jacobian is not None and model.residual is not None
    null = np.array([float(p.null or 0.0) / p.scale for c in model.candidates for p in c.parameters])
    for part, size in zip(model.parts(), model.sizes(), strict=True):
        others = basis(np.delete(model.jacobian, part, axis=1))
        own = model.jacobian[:, part] @ (model.values - null)[part]
        left = model.residual - own
        delta_chi2 = float(np.sum((left - others @ (others.T @ left)) ** 2) - model.chi2)
        if minus_log_p_of(delta_chi2, size) < search.threshold:
            return False
    return True


def _gain(before: Floats, after: Floats, label: NDArray[np.intp]) -> tuple[float, float]:
    """Mean over folds of the drop of the squared residual per reading, and its standard error."""
    each = np.array([np.nanmean(before[label == k] ** 2 - after[label == k] ** 2) for k in np.unique(label)])
    return float(each.mean()), float(each.std(ddof=1) / np.sqrt(len(each)))
