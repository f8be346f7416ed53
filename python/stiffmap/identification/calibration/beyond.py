"""Unknowns that their standard uncertainty cannot account for, one after the other.

Each in turn has its prior widened to a hundred times its standard uncertainty; where the evidence gains more than the
choice among all of them is worth, it is beyond tolerance. Those that would gain as much in its place are its rivals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stiffmap.experiment.experiment import Floats
from stiffmap.identification.calibration.facts import Beyond
from stiffmap.identification.calibration.groups import STRONG
from stiffmap.identification.calibration.limits import FREE, refused
from stiffmap.identification.calibration.statistics import Sums
from stiffmap.identification.calibration.unknowns import Unknown

LIKE = 0.1
"""Share of the evidence gained within which another unknown is a rival: a model is no better than that."""
FAR = 3.0
"""Standard uncertainties that a number must be off to be called beyond tolerance."""
MOST = 4
LEAST = 0.01
"""A compliance's or mass's factor is no smaller where a straight line makes it so."""
SHARE = 0.7
"""Of the folds that must gain."""


@dataclass(frozen=True, eq=False)
class BeyondTolerance:
    """Which unknowns go beyond, and the factor on each standard uncertainty."""

    found: tuple[Beyond, ...]
    which: tuple[int, ...]
    factor: Floats
    refused: tuple[str, ...] = ()
    """Those that no machine has so far off, and why."""

    def first(self, number: int) -> BeyondTolerance:
        """Those that were found first."""
        which = self.which[:number]
        factor = np.ones(len(self.factor))
        factor[list(which)] = FREE
        return BeyondTolerance(self.found[:number], which, factor, self.refused)

    def built(self, values: Floats, unknowns: Sequence[Unknown], at: Floats | None = None) -> Floats:
        """(p,) `values` (p,) with factors that have a widened prior, on which readings depend linearly, turned into the logarithm
        of what they are."""
        near = np.zeros(len(values)) if at is None else at
        out = values.copy()
        for i in (k for k in self.which if unknowns[k].unit == "ln"):
            times = max(as_factor(unknowns[i], float(values[i]), near[i]), LEAST)
            out[i] = float(np.log(times)) / unknowns[i].u
        return out


def beyond_tolerance(
    sums: Sums, unknowns: Sequence[Unknown], folds: Sequence[Sums] = (), at: Floats | None = None
) -> BeyondTolerance:
    """Forward search; the instrument's scale is its certificate's and its prior never widened, and what no machine has (`limits`)
    is passed over. Most of the `folds` must gain by themselves: a
    model's error that poses share is no noise, and sums over all of them overstate what they say.

    at
        (p,) where the columns of `sums` hold, in standard uncertainties; default: the declared numbers.
    """
    near = np.zeros(len(unknowns)) if at is None else at
    factor = np.ones(len(unknowns))
    found: list[Beyond] = []
    which: list[int] = []
    absurd: dict[int, str] = {}
    price = np.log(max(len(unknowns), 1)) + STRONG
    while len(found) < MOST and len(absurd) < MOST:
        gains = _gains(sums.scaled(factor))
        passed = [i for i, p in enumerate(unknowns) if factor[i] > 1.0 or p.of_instrument or i in absurd]
        gains[passed] = -np.inf
        best = int(np.argmax(gains)) if len(gains) else -1
        if best < 0 or gains[best] < price:
            break
        trial = factor.copy()
        trial[best] = FREE
        freed = sums.scaled(trial)
        value = float(freed.estimate[best] * FREE)
        p = unknowns[best]
        times = as_factor(p, value, near[best]) if p.unit == "ln" else 1.0
        if abs(value) < FAR or not _holds(folds, factor, best):
            break
        why = refused(p, value, times)
        if why:
            absurd[best] = f"{p.name}: {why}"
            continue
        factor = trial
        which.append(best)
        spread = float(np.sqrt(freed.covariance[best, best])) * FREE
        enough = gains[best] - max(STRONG, LIKE * gains[best])
        rivals = tuple(unknowns[i].name for i in np.argsort(-gains) if i != best and gains[i] > enough)
        size, wide = value * p.u, spread * p.u
        if p.unit == "ln":
            size, wide = float(np.log(times)), wide * float(np.exp(near[best] * p.u)) / times
        found.append(Beyond(p.name, size, wide, p.unit, float(gains[best]), rivals))
    return BeyondTolerance(tuple(found), tuple(which), factor, tuple(absurd.values()))


def none_beyond(number: int) -> BeyondTolerance:
    """All of so many unknowns within their tolerances."""
    return BeyondTolerance((), (), np.ones(number))


def as_factor(p: Unknown, value: float, at: float = 0.0) -> float:
    """Factor of a compliance or mass at `value`, found with the slope that its logarithm has `at` a place.

    Readings are linear in the factor itself: beyond small changes its logarithm is not what the slope says, and
    below zero there is none.
    """
    return float(np.exp(at * p.u) * (1.0 + (value - at) * p.u))


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
