"""Intervals by profile likelihood: the values at which chi-square, all else refitted, rises by 3.84."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from stiffmap.diagnosis.fit import fit
from stiffmap.diagnosis.model import Model
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.predict import Predictor
from stiffmap.experiment.problem import Problem, basis

UNSEEN = 0.25
"""A parameter whose standard deviation is beyond this share of its range is not determined at all."""
RISE = float(chi2.isf(0.05, 1))


def intervals(model: Model, predictor: Predictor, problem: Problem, inflation: float = 1.0) -> Floats:
    """(k, 2) lower and upper 95 % limits of the values, in scales.

    `inflation` >= 1 widens by the standard deviation of a residual that is not pure noise. A parameter that
    the readings do not determine has its whole range.
    """
    assert model.jacobian is not None
    low, high = model.bounds()
    out = np.zeros((len(model.values), 2))
    for i, value in enumerate(model.values):
        alone = seen_alone(model.jacobian, i)
        if unseen(model, i):
            out[i] = low[i], high[i]
            continue
        step = np.sqrt(RISE) / alone * inflation
        for side, sign in enumerate((-1.0, 1.0)):
            limit = (low, high)[side][i]
            out[i, side] = _end(model, predictor, problem, i, value, sign * step, limit, RISE * inflation**2)
    return out


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


def _end(
    model: Model,
    predictor: Predictor,
    problem: Problem,
    i: int,
    value: float,
    step: float,
    limit: float,
    rise: float,
) -> float:
    """Secant steps on the square root of the rise, which is nearly linear."""
    at = value + step
    for _ in range(4):
        if (at - limit) * np.sign(step) >= 0 or step == 0.0:
            return float(limit)
        got = _rise(model, predictor, problem, i, at)
        if not np.isfinite(got) or abs(got - rise) < 0.02 * rise or got <= 0:
            break
        at = value + (at - value) * min(4.0, max(0.25, float(np.sqrt(rise / got))))
    return float(at)


def _rise(model: Model, predictor: Predictor, problem: Problem, i: int, at: float) -> float:
    moved = model.values.copy()
    moved[i] = at
    start = replace(model, values=moved)
    return fit(start, predictor, problem, fixed=(i,)).chi2 - model.chi2
