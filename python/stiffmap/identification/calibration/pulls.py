"""Whether numbers within a fit are within their tolerances at all.

Many readings overrun a prior: the fit then has numbers far beyond their standard uncertainties without any having a widened prior.
If the uncertainties are right, the directions that the readings determine have pulls that are standard normal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, norm

from stiffmap.experiment.experiment import Floats, Mask
from stiffmap.identification.calibration.statistics import SEEN, Sums

SELDOM = 1e-3
"""Odds of what tolerances may be by chance."""
FACTORS = (2.0, 3.0, 5.0, 10.0, 20.0, 30.0, 50.0, 100.0)


@dataclass(frozen=True)
class Pulls:
    """How far the numbers of a fit are beyond their standard uncertainties."""

    rms: float
    """Of the directions that the readings determine; 1 where the uncertainties are right."""
    p: float
    """Probability of one as large if they are."""
    large: tuple[tuple[str, float], ...]
    """Unknowns whose own pull is too large for chance, the largest first."""

    @property
    def within(self) -> bool:
        """Whether tolerances may be so by chance."""
        return self.p >= SELDOM and not self.large

    @property
    def factor(self) -> float:
        """What ``--tolerance`` would have to be, at least."""
        worst = max((abs(v) for _, v in self.large), default=0.0) / 3.0
        return next((f for f in FACTORS if f >= max(self.rms, worst)), FACTORS[-1])


def pulls(sums: Sums, names: list[str], pull: Floats, told: Mask) -> Pulls:
    """`pull` (p,) of unknowns and whether the readings determine them (p,); `sums` at the uncertainties that they are judged by.

    Of a direction with singular value s the estimate from the readings alone has the variance 1 + 1/s² in standard
    uncertainties.
    """
    square, vectors = np.linalg.eigh(sums.gram)
    felt = square > SEEN**2
    along = vectors[:, felt].T @ sums.right
    total = float(np.sum(along**2 / (square[felt] * (1.0 + square[felt]))))
    number = int(felt.sum())
    limit = float(norm.isf(0.5 * SELDOM / max(int(told.sum()), 1)))
    large = [i for i in np.argsort(-np.abs(pull)) if told[i] and abs(pull[i]) > limit]
    return Pulls(
        float(np.sqrt(total / number)) if number else 0.0,
        float(chi2.sf(total, number)) if number else 1.0,
        tuple((names[i], float(pull[i])) for i in large),
    )
