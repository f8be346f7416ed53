"""Nested cross-validation by groups: outliers, selection and fit repeated inside every fold."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stiffmap.diagnosis.study import Study, alone, find
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.noise import Mask
from stiffmap.experiment.summary import Summary, summary

FOLDS = 5


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Readings that no fit saw."""

    before: Summary
    after: Summary
    residual: Floats
    """(n, 6) reading minus prediction of the model found without the row's group, `Study.free` of
    frames and zeros."""
    chosen: dict[str, int]
    """How many of the folds chose each effect."""
    folds: int
    by: str
    """``poses`` or ``set-ups``."""


def folds(experiment: Experiment, seed: int) -> tuple[NDArray[np.intp], str]:
    """(n,) fold of every row: whole set-ups where there are several, else whole poses."""
    setups = np.unique(experiment.setup or ("",) * len(experiment), return_inverse=True)[1]
    if setups.max() > 0:
        return setups, "set-ups"
    number = int(experiment.groups.max()) + 1
    label = np.random.default_rng(seed).permutation(number) % min(FOLDS, number)
    return label[experiment.groups], "poses"


def held_out(study: Study, listed: Mask, seed: int) -> HeldOut | None:
    """Residuals before and after on held-out groups; None where there are not two groups.

    Rows in `listed` (outliers of the whole experiment) and rows that the fold's own model finds
    standing alone count neither before nor after.
    """
    e = study.experiment
    label, by = folds(e, seed)
    if label.max() == 0:
        return None
    after = np.full_like(e.reading, np.nan)
    chosen: Counter[str] = Counter()
    for fold in range(int(label.max()) + 1):
        test = label == fold
        finding = find(study, ~test, finalists=3)
        chosen.update(map(str, finding.model.candidates))
        residual = study.free(e.reading - study.predictor(finding.model.terms()), listed)
        gone = alone(study, np.where(test[:, None], residual, np.nan)) & listed
        after[test & ~gone] = residual[test & ~gone]
    before = np.where(np.isfinite(after), study.free(e.reading - study.plan.base, listed), np.nan)
    sigma = study.noise.sigma
    return HeldOut(
        summary(before, sigma, e.channels),
        summary(after, sigma, e.channels),
        after,
        dict(chosen),
        int(label.max()) + 1,
        by,
    )
