"""Intervals by profile likelihood: the values at which chi-square, all else refitted, rises by 3.84."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq
from scipy.stats import chi2

from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.noise.level import Mask
from stiffmap.experiment.noise.whitening import Problem, basis
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.diagnosis.fitting.fit import fit
from stiffmap.identification.diagnosis.fitting.model import Model

UNSEEN = 0.25
"""A parameter whose standard deviation is beyond this share of its range is not determined at all."""
RISE = float(chi2.isf(0.05, 1))
DOUBLINGS = 6
NEAR, MISS = 5e-3, 0.05
"""Of the first step: how near the root is sought. Of the wanted rise's root: what counts as reached."""


@dataclass(frozen=True)
class Limits:
    """95 % limits of k values, in scales."""

    values: Floats
    """(k, 2) lower and upper."""
    found: Mask
    """(k, 2) whether chi-square rises by the wanted amount there; else the machine fails beyond, or no such
    place lies within the steps that are tried."""


def intervals(
    model: Model, predictor: Predictor, problem: Problem, inflation: float = 1.0, *, straight: bool = False
) -> Limits:
    """Lower and upper 95 % limits of the values; by the slopes alone where `straight`.

    `inflation` >= 1 widens by the standard deviation of a residual that is not pure noise. A parameter that
    the readings do not determine has its whole range.
    """
    assert model.jacobian is not None
    low, high = model.bounds()
    out = np.zeros((len(model.values), 2))
    found = np.ones(out.shape, dtype=bool)
    for i, value in enumerate(model.values):
        alone = seen_alone(model.jacobian, i)
        if unseen(model, i):
            out[i] = low[i], high[i]
            continue
        step = np.sqrt(RISE) / alone * inflation
        if straight:
            out[i] = np.clip([value - step, value + step], low[i], high[i])
            continue

        def rise(at: float, i: int = i) -> float:
            return _rise(model, predictor, problem, i, at)

        for side, sign in enumerate((-1.0, 1.0)):
            limit = (low, high)[side][i]
            out[i, side], found[i, side] = profile_end(rise, value, sign * step, limit, RISE * inflation**2)
    return Limits(out, found)


def unseen(model: Model, i: int) -> bool:
    """Whether the readings do not determine value i: its interval would be its whole range."""
    assert model.jacobian is not None
    low, high = model.bounds()
    return bool(seen_alone(model.jacobian, i) * (high[i] - low[i]) * UNSEEN < 1.0)


def seen_alone(jacobian: Floats, i: int) -> float:
    """Whitened length per scale of what parameter i changes and the others cannot undo."""
    others = basis(np.delete(jacobian, i, axis=1))
    own = jacobian[:, i]
    return float(np.linalg.norm(own - others @ (others.T @ own)))


def profile_end(
    rise: Callable[[float], float], value: float, step: float, limit: float, wanted: float
) -> tuple[float, bool]:
    """Where `rise` from 0 at `value` reaches `wanted`, towards `step`, and whether it does there.

    The bracket grows twofold up to the `limit`, which is the end where the rise stays below. Its square root,
    nearly linear, is solved by Brent's method. What is not finite counts as beyond.
    """

    def gap(at: float) -> float:
        got = rise(at)
        return float(np.sqrt(max(got, 0.0)) - np.sqrt(wanted)) if np.isfinite(got) else float(np.sqrt(wanted))

    inside, outside = value, value + step
    for _ in range(DOUBLINGS):
        last = (outside - limit) * np.sign(step) >= 0
        outside = limit if last else outside
        if outside == inside:
            return float(limit), True
        if gap(outside) >= 0:
            at = float(brentq(gap, inside, outside, xtol=NEAR * abs(step), rtol=4 * np.finfo(float).eps))
            return at, bool(abs(gap(at)) < MISS * np.sqrt(wanted))
        if last:
            return float(limit), True
        inside, outside = outside, value + 2 * (outside - value)
    return float(inside), False


def _rise(model: Model, predictor: Predictor, problem: Problem, i: int, at: float) -> float:
    """Rise of chi-square with value i at a place, from where the others would go if all were straight."""
    assert model.jacobian is not None
    moved = model.values.copy()
    others = [k for k in range(len(moved)) if k != i and k not in model.held]
    change = model.jacobian[:, i] * (at - moved[i])
    moved[others] -= np.linalg.lstsq(model.jacobian[:, others], change, rcond=1e-9)[0]
    moved[i] = at
    start = replace(model, values=moved)
    return fit(start, predictor, problem, fixed=(i,), near=model.jacobian).chi2 - model.chi2
