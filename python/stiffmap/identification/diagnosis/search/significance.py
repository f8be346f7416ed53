"""Significance of the best of all candidates: the search itself is repeated on noise alone."""

from __future__ import annotations

from typing import Any

import numpy as np

from stiffmap.common.broadcasting import random_numbers
from stiffmap.common.tasks import workers
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.noise.whitening import Problem, readings_of
from stiffmap.identification.diagnosis.candidates.stack import Stack
from stiffmap.identification.diagnosis.search.screen import Screen

ALPHA = 1e-4
"""Probability of naming anything where there is nothing, over the whole search."""
DRAWS = 1000
TOGETHER = 100
"""Draws of one task."""
ENOUGH, FEWER = 4000, 300
"""Readings on which the worth of a search is found out, and draws where there are more: how alike the candidates are shows
on a part of the plan."""


def effective_number_of_trials(screen: Screen, seed: int, draws: int = DRAWS, scheduler: Any = None) -> float:
    """How many independent tests the search is worth (parametric bootstrap of the whole search).

    Under the null the smallest of the candidates' p-values is below p with probability
    1 - exp(-M p). M follows from the median over simulated noise and holds for smaller p, where
    simulating would need millions of draws. Bounds and unidentified parameters are in, since every
    draw runs the same signed search over all variants. With a scheduler its workers search; the noise is drawn here, so
    that the answer is the same.
    """
    if not screen.rank.any():
        return 1.0
    rng = random_numbers(seed)
    noise = (rng.standard_normal((screen.readings, TOGETHER)) for _ in range(max(1, draws // TOGETHER)))
    with workers(_best_of, screen, scheduler=scheduler) as hands:
        best = hands.in_order(noise)
    median = float(np.median(np.concatenate(best)))
    return max(1.0, float(np.log(2.0) * np.exp(median)))


def _best_of(screen: Screen, noise: Floats) -> Floats:
    """(draws,) the search on each column of noise (readings, draws), as a task."""
    return screen.largest_minus_log_p(noise)


def on_enough_rows(problem: Problem, stack: Stack, columns: Floats | None, seed: int) -> Screen:
    """The screen of the variants on whole poses, drawn until they have `ENOUGH` readings; `columns` (n, c, p) of what is
    uncertain."""
    e = problem.experiment
    at, _ = readings_of(e, problem.base)
    count = np.bincount(e.groups[at], minlength=int(e.groups.max()) + 1)
    order = random_numbers(seed).permutation(len(count))
    drawn = order[np.cumsum(count[order]) <= ENOUGH]
    rows = np.isin(e.groups, drawn)
    part = e.rows(rows)
    uncertain = None if columns is None else columns[rows]
    few = Problem.of(part, problem.sigma[rows], problem.base[rows], None, uncertain)
    return Screen.of(few, stack.on(rows, rows[at]))


def global_p(minus_log_p: float, trials: float) -> float:
    """p-value over the whole search: that noise alone gives some candidate such a -ln p."""
    return float(-np.expm1(-trials * np.exp(-minus_log_p)))


def needed(trials: float, alpha: float = ALPHA) -> float:
    """-ln p at which the whole search has the false-alarm rate `alpha`."""
    return float(np.log(trials / -np.log1p(-alpha)))
