"""Noise as a fit leaves it: how large compared with what is declared, along time, and in its tails."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.noise.whitening import Problem

SELDOM = 1e-3
"""Odds of what is called noise other than declared."""
FEWEST = 20
"""Readings from which a fit says anything of the noise."""
SURE = 4.0
"""Standard deviations of a correlation or of a kurtosis that chance does not make."""
LARGEST = 0.95


@dataclass(frozen=True)
class AsLeft:
    """Of whitened residuals."""

    ratio: float
    """Root mean square relative to what is declared, degrees of freedom taken off."""
    other: bool
    """Whether that is other than declared."""
    along_time: float
    """Correlation from one row to the next in order; 0 where none is sure, or no order was recorded."""
    tails: float
    """Kurtosis beyond a normal law's; 0 where none is sure."""

    @property
    def widening(self) -> float:
        """Factor on standard deviations that were computed for independent noise as declared."""
        own = self.ratio if self.other else 1.0
        return float(own * np.sqrt((1.0 + self.along_time) / (1.0 - self.along_time)))

    def sentences(self) -> list[str]:
        """What a reader must know."""
        out = []
        if self.other and self.ratio < 1.0:
            out.append(
                f"the declared noise is {1.0 / self.ratio:.2g} times what the fit leaves; intervals are by what it leaves"
            )
        if self.other and self.ratio > 1.0:
            out.append(
                f"the fit leaves {self.ratio:.2g} times the declared noise; intervals are by what it leaves"
            )
        if self.along_time:
            out.append(
                f"noise is correlated along time ({self.along_time:.2g} from one row to the next); intervals are wider for it"
            )
        if self.tails:
            out.append(
                "noise has heavier tails than a normal law: single rows say less than their noise promises"
            )
        return out


def as_left(problem: Problem, residual: Floats, parameters: int) -> AsLeft:
    """Of the residual (N,) that a fit with so many parameters leaves, whitened to declared noise."""
    freedom = len(residual) - parameters - int(problem.nuisance.shape[1])
    if freedom < FEWEST:
        return AsLeft(1.0, False, 0.0, 0.0)
    square = float(residual @ residual)
    p = 2.0 * min(float(chi2.cdf(square, freedom)), float(chi2.sf(square, freedom)))
    z = residual / np.sqrt(square / freedom)
    kurtosis = float(np.mean(z**4) / np.mean(z**2) ** 2 - 3.0)
    spread = float(np.sqrt(24.0 / len(z)))
    return AsLeft(
        float(np.sqrt(square / freedom)),
        p < SELDOM,
        _along_time(problem, z),
        kurtosis if kurtosis > SURE * spread else 0.0,
    )


def _along_time(problem: Problem, z: Floats) -> float:
    """Correlation of each channel from one row to the next."""
    order = problem.experiment.order
    if order is None:
        return 0.0
    row, axis = problem.index
    rank = np.lexsort((order[row], axis, problem.experiment.runs[row]))
    a, b = rank[:-1], rank[1:]
    same = (axis[a] == axis[b]) & (problem.experiment.runs[row[a]] == problem.experiment.runs[row[b]])
    if same.sum() < FEWEST:
        return 0.0
    one, other = z[a[same]], z[b[same]]
    r = float(one @ other / np.sqrt((one @ one) * (other @ other)))
    return min(r, LARGEST) if r > SURE / np.sqrt(same.sum()) else 0.0
