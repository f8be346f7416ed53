"""Directions of readings that averages of repeats and unknown frames, tools and zeros leave free.

They are columns of a block reflector (Schreiber, Parlett, SIAM J. Numer. Anal. 25 (1988) 189): all but a few of them are readings
themselves but for a few directions. So noise of any weights costs as much as those few, not as all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg.blas import dsymm

from stiffmap.experiment.experiment import Floats


@dataclass(frozen=True, eq=False)
class Free:
    """Of N readings with M averages, of which q directions are taken: m = M - q are free."""

    mean: Floats
    """(N, M) orthonormal columns that average repeats: one number in each row."""
    low: Floats
    """(m, q) the taken directions at all averages but the first q, turned so that the first q are symmetric."""
    gain: Floats
    """(m, q)."""
    matrix: Floats
    """(N, m) the free directions: of the averages -lowᵀ, then 1 - gain lowᵀ."""

    @staticmethod
    def across(taken: Floats, mean: Floats) -> Free:
        """Across orthonormal directions `taken` (M, q) of averages."""
        q = taken.shape[1]
        left, _, right = np.linalg.svd(taken[:q])
        turned = taken @ (right.T @ left.T)
        low = turned[q:]
        gain = np.linalg.solve(np.eye(q) + turned[:q], low.T).T
        return Free(mean, low, gain, mean @ np.vstack([-low.T, np.eye(len(low)) - gain @ low.T]))

    def of_noise(self, variance: Floats) -> Floats:
        """(m, m) covariance along the free directions of noise of variances (N,)."""
        d = (self.mean**2).T @ variance
        q = self.low.shape[1]
        scaled = d[q:, None] * self.gain
        half = scaled - 0.5 * self.low @ (np.diag(d[:q]) + self.gain.T @ scaled)
        across = half @ self.low.T
        return np.asarray((np.diag(d[q:]) - across - across.T).T)

    def at_readings(self, information: Floats) -> Floats:
        """(N,) diagonal at the readings of a symmetric matrix (m, m) along the free directions, of which the lower half is read."""
        along = dsymm(1.0, information, self.low, lower=1)
        inner = self.low.T @ along
        rest = np.diag(information) + np.sum(self.gain * (self.gain @ inner - 2.0 * along), axis=1)
        return np.asarray(self.mean**2 @ np.append(np.diag(inner), rest))
