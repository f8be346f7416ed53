"""Mean reading of each condition, and the covariance of contrasts of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stiffmap.experiment.experiment import Experiment, Floats, Integers
from stiffmap.experiment.noise.level import Mask

Contrast = tuple[list[tuple[int, int]], list[float]]
"""(condition, channel) pairs and their weights."""


@dataclass(frozen=True, eq=False)
class Conditions:
    """Means of repeats; k conditions, c channels."""

    mean: Floats
    """(k, c)."""
    variance: Floats
    """(k, c) of the mean, the zero apart."""
    zero: Floats
    """(c,) variance of the zero that a pose's readings share."""
    zero_known: bool
    """False: the state without load is unknown, and only what does not depend on it can be tested."""
    wrench: Floats
    group: Integers
    """(k,) pose number."""
    state: Integers
    """(k,) number of what else may differ between conditions of a pose."""
    unloading: Mask
    work_conjugate: bool
    """Whether the force acts where the reading is taken, from and to the floor or base."""

    @staticmethod
    def of(e: Experiment, values: Floats, sigma: Floats, keep: Mask) -> Conditions:
        """Weighted means of the kept rows of each condition."""
        good = np.isfinite(values) & np.isfinite(sigma) & keep[:, None]
        weight = np.where(good, 1.0 / np.where(good, sigma, 1.0) ** 2, 0.0)
        total = _sums(e, weight)
        sums = _sums(e, np.where(good, values, 0.0) * weight)
        first = np.unique(e.conditions, return_index=True)[1]
        branch = np.array(e.branch or ("",) * len(e))[first]
        safe = np.where(total > 0, total, 1.0)
        return Conditions(
            np.where(total > 0, sums / safe, np.nan),
            np.where(total > 0, 1.0 / safe, np.nan),
            e.zeros**2,
            e.unloaded != "unknown",
            e.wrench[first],
            e.groups[first],
            _states(e)[first],
            branch == "unloading",
            _conjugate(e),
        )

    def usable(self, contrast: Contrast) -> bool:
        """Whether all means are known, and the zero cancels where it is not."""
        where, weights = contrast
        if not all(np.isfinite(self.mean[at]) for at in where):
            return False
        return self.zero_known or abs(sum(weights)) < 1e-12

    def values_of(self, contrasts: list[Contrast]) -> Floats:
        """(m,) contrasts."""
        return np.array([sum(w * self.mean[at] for at, w in zip(*c, strict=True)) for c in contrasts])

    def covariance_of(self, contrasts: list[Contrast]) -> Floats:
        """(m, m) of contrasts of one pose."""
        cells = sorted({at for where, _ in contrasts for at in where})
        index = {at: i for i, at in enumerate(cells)}
        matrix = np.zeros((len(contrasts), len(cells)))
        for row, (where, weights) in enumerate(contrasts):
            for at, w in zip(where, weights, strict=True):
                matrix[row, index[at]] += w
        channel = np.array([a for _, a in cells])
        shared = np.where(channel[:, None] == channel, self.zero[channel], 0.0)
        v = np.diag([self.variance[at] for at in cells]) + shared
        return np.asarray(matrix @ v @ matrix.T)


def _sums(e: Experiment, values: Floats) -> Floats:
    number = int(e.conditions.max()) + 1
    return np.stack([np.bincount(e.conditions, v, number) for v in values.T], axis=1)


def _states(e: Experiment) -> Integers:
    """(n,) number of everything but pose and load: only alike conditions are compared. Temperature is not
    among it: the unloaded reading is as warm as the loaded one."""
    parts = [np.zeros(len(e))]
    words = [e.branch, e.setup, e.points, e.load_points]
    parts += [np.unique(w, return_inverse=True)[1].reshape(-1).astype(float) for w in words if w]
    parts += list(e.approach.T) if e.approach is not None else []
    return np.unique(np.column_stack(parts), axis=0, return_inverse=True)[1].reshape(-1)


def _conjugate(e: Experiment) -> bool:
    points = e.points or (e.point,) * len(e)
    loads = e.load_points or (e.load_point,) * len(e)
    whole = e.loop.instrument_on == e.loop.force_against and e.loop.target_on == "tool"
    return points == loads and whole
