"""Is an effect the same everywhere? A pattern that only resembles the effect gives another size in each
part of the workspace and under each load; a real one does not."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stiffmap.experiment.experiment import Integers
from stiffmap.experiment.noise.whitening import Problem
from stiffmap.identification.diagnosis.fitting.model import Model

STEADY = 0.35
"""Largest relative change of an effect between halves of the data where an unexplained residual remains."""
SHARE = 0.8
"""Share of the misfit that effects must explain to be named where an unexplained residual remains."""


def steady(problem: Problem, model: Model) -> list[bool]:
    """Per effect: whether its parameters agree between the halves of the data, noise allowed for."""
    assert model.jacobian is not None and model.residual is not None
    change = np.zeros(len(model.values))
    for half in halves(problem):
        j, r = model.jacobian[half], model.residual[half]
        step, *_ = np.linalg.lstsq(j, -r, rcond=1e-9)
        spread = np.sqrt(np.diag(np.linalg.pinv(j.T @ j, hermitian=True)))
        change = np.maximum(change, np.maximum(np.abs(step) - 3 * spread, 0.0))
    null = np.array([float(p.null or 0.0) / p.scale for c in model.candidates for p in c.parameters])
    size = np.abs(model.values - null)
    return [bool(np.linalg.norm(change[s]) <= STEADY * np.linalg.norm(size[s])) for s in model.parts()]


def halves(problem: Problem) -> Iterator[Integers]:
    """Readings of each half of the workspace along each coordinate, and of each sign of each force."""
    e, rows = problem.experiment, problem.index[0]
    for a in range(3):
        upper = e.position[:, a] > np.median(e.position[:, a])
        yield np.flatnonzero(upper[rows])
        yield np.flatnonzero(~upper[rows])
        if e.quantity == "deflection" and e.wrench[:, a].any():
            yield np.flatnonzero(e.wrench[rows, a] > 0)
            yield np.flatnonzero(e.wrench[rows, a] < 0)


def explained(null: Model, model: Model, freedom: int) -> float:
    """Share of the misfit beyond noise that the model takes away; where noise is less than `freedom`, what the model leaves."""
    excess = null.chi2 - min(float(freedom), model.chi2)
    return float((null.chi2 - model.chi2) / excess) if excess > 0 else 1.0
