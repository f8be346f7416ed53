"""Which readings are held out together."""

from __future__ import annotations

from stiffmap.common.broadcasting import random_numbers
from stiffmap.experiment.experiment import Experiment, Integers

FOLDS = 5


def folds(experiment: Experiment, seed: int) -> tuple[Integers, str]:
    """(n,) fold of every row: whole set-ups where there are several, else whole poses."""
    if experiment.runs.max() > 0:
        return experiment.runs, "set-ups"
    number = int(experiment.groups.max()) + 1
    label = random_numbers(seed).permutation(number) % min(FOLDS, number)
    return label[experiment.groups], "poses"
