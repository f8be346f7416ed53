"""The model-form floor: what the best model leaves beyond the noise, as a variance component.

Readings of one pose share what a model gets wrong there, repeats or not: a random effect per pose and
channel, variance rho in units of the noise variance, beside which the calibration is estimated again. rho
maximises the restricted likelihood (REML; Patterson and Thompson 1971). docs/theory.md (M2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from stiffmap.calibration.statistics import Sums
from stiffmap.experiment.experiment import Floats, Integers

LARGEST = 1e8


@dataclass(frozen=True, eq=False)
class Blocks:
    """Whitened readings in blocks that share a random effect."""

    number: Integers
    """(K,) readings per block."""
    columns: Floats
    """(K, p) sums of the columns over each block."""
    residual: Floats
    """(K,) sums of the residuals."""
    within: Sums
    """All readings, as if independent."""

    @staticmethod
    def of(columns: Floats, residual: Floats, label: Integers, nuisances: int = 0) -> Blocks:
        """`label` (N,) says which block a reading belongs to."""
        _, at = np.unique(label, return_inverse=True)
        at = at.reshape(-1)
        k = int(at.max()) + 1 if len(at) else 0
        sums = np.zeros((k, columns.shape[1]))
        np.add.at(sums, at, columns)
        return Blocks(
            np.bincount(at, minlength=k).astype(np.intp),
            sums,
            np.asarray(np.bincount(at, residual, minlength=k), dtype=float),
            Sums.of(columns, residual, len(residual) - nuisances),
        )

    def scaled(self, factor: Floats) -> Blocks:
        """The blocks with each column times a factor (p,)."""
        return Blocks(self.number, self.columns * factor, self.residual, self.within.scaled(factor))

    def beside(self, rho: float) -> Sums:
        """Sums where each block has a random effect of variance rho: V = I + rho 1 1ᵀ per block."""
        c = rho / (1.0 + self.number * rho)
        s, w = self.columns, self.within
        return Sums(
            w.gram - s.T @ (c[:, None] * s),
            w.right - s.T @ (c * self.residual),
            w.square - float(c @ self.residual**2),
            w.number,
        )

    def log_likelihood(self, rho: float) -> float:
        """Of rho, all unknowns integrated out over their priors."""
        return self.beside(rho).log_evidence - 0.5 * float(np.log1p(self.number * rho).sum())


def model_form(blocks: Blocks) -> float:
    """rho of the largest likelihood: variance of the model's error per pose, in noise variances."""
    if not len(blocks.number):
        return 0.0
    found = minimize_scalar(
        lambda x: -blocks.log_likelihood(float(np.expm1(x))),
        bounds=(0.0, float(np.log1p(LARGEST))),
        method="bounded",
        options={"xatol": 1e-4},
    )
    rho = float(np.expm1(found.x))
    return rho if blocks.log_likelihood(rho) > blocks.log_likelihood(0.0) + 1.0 else 0.0
