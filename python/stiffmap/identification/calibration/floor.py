"""The model-form floor: what the best model leaves beyond the noise, as a variance component.

Readings of one pose share what a model gets wrong there, repeats or not: a random effect per pose and
channel, variance rho in units of the noise variance, with which the calibration is estimated again. rho
maximises the restricted likelihood (REML; Patterson and Thompson 1971). docs/theory.md (I2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from stiffmap.experiment.experiment import Floats, Integers
from stiffmap.identification.calibration.statistics import Sums

LARGEST = 1e8


@dataclass(frozen=True, eq=False)
class Blocks:
    """Whitened readings in blocks that share a random effect; sums over blocks, by how many readings they have."""

    number: Integers
    """(m,) different numbers of readings per block."""
    count: Integers
    """(m,) how many blocks have so many."""
    within: Sums
    """All readings, as if independent."""
    between: tuple[Sums, ...]
    """(m,) of the sums of columns and residuals over each block."""

    @staticmethod
    def of(columns: Floats, residual: Floats, label: Integers, nuisances: int = 0) -> Blocks:
        """`label` (N,) says which block a reading belongs to."""
        within = Sums.of(columns, residual, len(residual) - nuisances)
        if not len(label):
            none = np.zeros(0, np.intp)
            return Blocks(none, none, within, ())
        order = np.argsort(label, kind="stable")
        _, first, size = np.unique(label[order], return_index=True, return_counts=True)
        number, count = np.unique(size, return_counts=True)
        if number[-1] == 1:
            between: tuple[Sums, ...] = (within,)
        else:
            sums = np.add.reduceat(columns[order], first, axis=0) if columns.shape[1] else columns[first]
            rest = np.add.reduceat(residual[order], first)
            between = tuple(Sums.of(sums[size == m], rest[size == m]) for m in number)
        return Blocks(number.astype(np.intp), count.astype(np.intp), within, between)

    @property
    def typical(self) -> float:
        """Readings of the median block."""
        return float(np.median(np.repeat(self.number, self.count)))

    def pick(self, which: Sequence[int] | Integers) -> Blocks:
        """Of some unknowns, the others at zero."""
        return replace(
            self, within=self.within.pick(which), between=tuple(s.pick(which) for s in self.between)
        )

    def scaled(self, factor: Floats) -> Blocks:
        """With each standard uncertainty times a factor (p,)."""
        between = tuple(s.scaled(factor) for s in self.between)
        return replace(self, within=self.within.scaled(factor), between=between)

    def beside(self, rho: float) -> Sums:
        """Sums where each block has a random effect of variance rho: V = I + rho 1 1ᵀ per block."""
        out = self.within
        for m, s in zip(self.number, self.between, strict=True):
            out = out - s.weighed(rho / (1.0 + float(m) * rho))
        return replace(out, number=self.within.number)

    def log_likelihood(self, rho: float) -> float:
        """Of rho, all unknowns integrated out over their priors."""
        return self.beside(rho).log_evidence - 0.5 * float(self.count @ np.log1p(self.number * rho))


def model_form(blocks: Blocks) -> float:
    """rho of the largest likelihood: variance of the model's error per pose, in noise variances."""
    if not len(blocks.number):
        return 0.0
    rho, best = likeliest(blocks, 1e-4)
    return rho if best > blocks.log_likelihood(0.0) + 1.0 else 0.0


def likeliest(blocks: Blocks, within: float) -> tuple[float, float]:
    """rho > 0 of the largest likelihood, its logarithm within so much, and the logarithm of that likelihood."""
    found = minimize_scalar(
        lambda x: -blocks.log_likelihood(float(np.expm1(x))),
        bounds=(0.0, float(np.log1p(LARGEST))),
        method="bounded",
        options={"xatol": within},
    )
    return float(np.expm1(found.x)), -float(found.fun)
