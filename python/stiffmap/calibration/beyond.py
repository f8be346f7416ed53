"""Unknowns that their standard uncertainty cannot account for, one after the other.

Each in turn is let go a hundred times beyond its standard uncertainty; where the evidence gains more than the
choice among all of them is worth, it is beyond tolerance. Those that would gain as much in its place are its rivals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stiffmap.calibration.facts import Beyond
from stiffmap.calibration.groups import STRONG
from stiffmap.calibration.statistics import Sums
from stiffmap.calibration.unknowns import Unknown
from stiffmap.experiment.experiment import Floats

FREE = 100.0
"""Times the standard uncertainty; what goes further is no number of this machine."""
LIKE = 0.1
"""Share of the evidence gained within which another unknown is a rival: a model is no better than that."""
FAR = 3.0
"""Standard uncertainties that a number must be off to be called beyond tolerance."""
MOST = 4
WIDEST = float(np.log(100.0))
"""Of a factor's logarithm; beyond it something else is wrong."""
SHARE = 0.7
"""Of the folds that must gain."""


@dataclass(frozen=True, eq=False)
class BeyondTolerance:
    """Which unknowns go beyond, and the factor on each standard uncertainty."""

    found: tuple[Beyond, ...]
    which: tuple[int, ...]
    factor: Floats


def beyond_tolerance(sums: Sums, unknowns: Sequence[Unknown], folds: Sequence[Sums] = ()) -> BeyondTolerance:
    """Forward search; the instrument's scale is its certificate's and never let go, and a mass or compliance
    goes no further than `WIDEST`. Most of the `folds` must gain by themselves: a model's error that
    poses share is no noise, and sums over all of them overstate what they say.
    """
    factor = np.ones(len(unknowns))
    found: list[Beyond] = []
    which: list[int] = []
    price = np.log(max(len(unknowns), 1)) + STRONG
    for _ in range(MOST):
        gains = _gains(sums.scaled(factor))
        gains[[i for i, p in enumerate(unknowns) if factor[i] > 1.0 or p.of_instrument]] = -np.inf
        best = int(np.argmax(gains)) if len(gains) else -1
        if best < 0 or gains[best] < price:
            break
        trial = factor.copy()
        trial[best] = FREE
        freed = sums.scaled(trial)
        value = float(freed.estimate[best] * FREE)
        p = unknowns[best]
        if (
            abs(value) < FAR
            or (p.unit == "ln" and abs(value) * p.u > WIDEST)
            or not _holds(folds, factor, best)
        ):
            break
        factor = trial
        which.append(best)
        spread = float(np.sqrt(freed.covariance[best, best])) * FREE
        enough = gains[best] - max(STRONG, LIKE * gains[best])
        rivals = tuple(unknowns[i].name for i in np.argsort(-gains) if i != best and gains[i] > enough)
        found.append(Beyond(p.name, value * p.u, spread * p.u, p.unit, float(gains[best]), rivals))
    return BeyondTolerance(tuple(found), tuple(which), factor)


def _holds(folds: Sequence[Sums], factor: Floats, i: int) -> bool:
    """Whether letting unknown i go pays in most of the folds, each by itself."""
    gains = [_gains(f.scaled(factor))[i] > 0.0 for f in folds]
    return not gains or sum(gains) >= SHARE * len(gains)


def _gains(sums: Sums) -> Floats:
    """(p,) evidence gained by each unknown alone with `FREE` times its standard uncertainty.

    What the readings say of one unknown, the others integrated out, is a normal likelihood of precision k
    and weighted mean h; over a prior N(0, f²) it integrates to exp(½ h² f² / (1 + f² k)) / √(1 + f² k).
    """
    variance = np.diag(sums.covariance)
    k, h = np.maximum(1.0 / variance - 1.0, 0.0), sums.estimate / variance

    def log_integral(f: float) -> Floats:
        return np.asarray(0.5 * h**2 * f**2 / (1.0 + f**2 * k) - 0.5 * np.log1p(f**2 * k))

    return log_integral(FREE) - log_integral(1.0)
