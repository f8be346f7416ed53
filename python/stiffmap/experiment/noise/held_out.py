"""Readings that a fit has not seen: which are held out together, and their unknown frames, tools and zeros."""

from __future__ import annotations

import numpy as np

from stiffmap.common.broadcasting import random_numbers
from stiffmap.experiment.experiment import Experiment, Floats, Integers, Mask
from stiffmap.experiment.noise.nuisance import nuisance_columns
from stiffmap.experiment.noise.whitening import LinearProblem, best_fit

FOLDS = 5


def folds(experiment: Experiment, seed: int) -> tuple[Integers, str]:
    """(n,) fold of every row: whole set-ups where there are several, else whole poses."""
    if experiment.runs.max() > 0:
        return experiment.runs, "set-ups"
    number = int(experiment.groups.max()) + 1
    label = random_numbers(seed).permutation(number) % min(FOLDS, number)
    return label[experiment.groups], "poses"


def left_unseen(e: Experiment, sigma: Floats, prediction: Floats, seen: Mask, unseen: Mask) -> Floats:
    """(n, c) reading minus prediction (n, c) at noise `sigma` (n, c), less the nuisances of rows `unseen` (n,) as those in
    `seen` (n,) determine them. What frames and tools change is taken at the prediction."""
    others, own = (LinearProblem.of(e, sigma, prediction, rows) for rows in (seen, unseen))
    left = e.reading - prediction
    return np.asarray(left - unseen_nuisances(others, own, left))


def unseen_nuisances(others: LinearProblem, own: LinearProblem, values: Floats) -> Floats:
    """(n, c) what nuisances say of `values` (n, c) where the readings of `own` are held out: as the readings of `others`
    determine them; those that none of `others` knows (the frame of another set-up, the zero of another pose) as their
    own readings do."""
    columns = nuisance_columns(others.experiment, others.base)
    known = np.abs(np.nan_to_num(columns[others.index])).max(axis=0, initial=0.0) > 0.0
    said = best_fit(others, columns[..., known], values)
    return np.asarray(said + best_fit(own, columns[..., ~known], values - said))
