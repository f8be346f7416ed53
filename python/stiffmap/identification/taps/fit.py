"""Causes of a tap test that are fitted together with the uncertain numbers of the machine file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from stiffmap.common.broadcasting import Floats
from stiffmap.identification.candidates.candidates import Candidate
from stiffmap.identification.inference.constants import ODDS, RARE
from stiffmap.identification.inference.optimum import Optimum, covariance, differences, optimum
from stiffmap.identification.taps.problem import Causes, TapsProblem
from stiffmap.model.effects import Parameter
from stiffmap.solve.machine import Machine

STEPS = 25
STEP = 0.02
"""Of a difference, in standard uncertainties or logarithms of a factor."""
WIDEST = 6.0
"""Standard uncertainties by which a number is off at most."""


@dataclass(frozen=True)
class Explained:
    """One candidate, fitted."""

    place: Candidate
    parameters: dict[str, float]
    """SI."""
    u: dict[str, float]
    chi2: float
    """Of all readings by their noise, and of the uncertain numbers by their uncertainty."""
    statics: float | None = None
    """Parameter by static readings alone; None: not both were there."""
    taps: float | None = None
    """The same by frequencies alone."""
    disagreement: float | None = None
    """Standard deviations between the two."""
    alike: tuple[Explained, ...] = ()
    """Candidates that the readings cannot distinguish from this one."""

    @property
    def candidate(self) -> str:
        """Kind, element and legs in words."""
        return str(self.place)

    @property
    def value(self) -> float:
        """SI."""
        return next(iter(self.parameters.values()))

    @property
    def sd(self) -> float:
        """SI."""
        return next(iter(self.u.values()))

    def by(self, statics: Explained, taps: Explained) -> Explained:
        """With its parameter by static readings alone and by frequencies alone, where each determines it."""
        one, two = statics.value, taps.value
        sd = float(np.hypot(statics.sd, taps.sd))
        if not np.isfinite(sd):
            return self
        return replace(self, statics=one, taps=two, disagreement=abs(one - two) / sd)


@dataclass(frozen=True, eq=False)
class FittedCauses:
    """A set of causes, fitted together with the uncertain numbers."""

    named: tuple[Explained, ...]
    chi2: float
    machine: Machine
    lines: Optimum
    """Where the uncertain numbers (k,) are, the residual (n,) there, and its change (n, k) by each, with the causes as they are."""
    own: Floats
    """(n, causes) change of the residual by each cause."""

    @property
    def explains(self) -> bool:
        """Whether chi-square is no larger than chance lets it be."""
        return bool(chi2.sf(self.chi2, len(self.lines.residual)) > RARE)

    @property
    def causes(self) -> Causes:
        """SI."""
        return [(e.place, e.value) for e in self.named]


def best_of(fits: Sequence[FittedCauses], places: int) -> FittedCauses:
    """The set of least chi-square, of which each cause must be worth the odds of a name at any of so many places; in the noise that
    the closest set leaves."""
    noise = max(1.0, min(f.chi2 / len(f.lines.residual) for f in fits))
    return min(fits, key=lambda f: f.chi2 + noise * price(places) * len(f.named))


def price(places: int) -> float:
    """Chi-square that a cause must be worth."""
    return 2.0 * float(np.log(ODDS) + np.log(places))


def fitted(problem: TapsProblem, begin: Causes, off: Floats | None = None) -> FittedCauses:
    """Least chi-square of causes near their values, within the bounds of these, and of the uncertain numbers near `off` (numbers,)
    within their uncertainty, which are not taken to be small."""
    tried, numbers = [c for c, _ in begin], [c.parameters[0] for c, _ in begin]
    k, n, most = len(tried), int(problem.used.sum()), np.full(len(problem.numbers), WIDEST)

    def at(x: Floats) -> Causes:
        return [(c, in_si(p, t)) for c, p, t in zip(tried, numbers, x[:k], strict=True)]

    def residual(x: Floats) -> Floats:
        return np.concatenate([problem.residual(at(x), x[k:]), x[k:]])

    start = [free_number(p, value) for p, (_, value) in zip(numbers, begin, strict=True)]
    low = [free_number(p, p.lower) for p in numbers]
    high = [free_number(p, p.upper) for p in numbers]
    fit = optimum(
        residual,
        np.r_[start, np.zeros(len(most)) if off is None else off],
        (np.r_[low, -most], np.r_[high, most]),
        lambda x: differences(residual, x, STEP),
        STEPS,
    )
    found = []
    variances = np.diag(covariance(fit.jacobian)[0])[:k]
    for (c, value), p, variance in zip(at(fit.x), numbers, variances, strict=True):
        u = float(np.sqrt(variance)) * (value if p.null == 1.0 else p.scale)
        found.append(Explained(c, {p.name: value}, {p.name: u}, fit.chi2))
    machine, _ = problem.real(at(fit.x), fit.x[k:])
    slopes = fit.jacobian[:n]
    lines = Optimum(fit.x[k:], fit.residual[:n], slopes[:, k:])
    return FittedCauses(tuple(found), fit.chi2, machine, lines, slopes[:, :k])


def in_si(p: Parameter, free: float) -> float:
    """A parameter by its free number, the logarithm of a factor and else in typical sizes, within its bounds."""
    return float(np.clip(np.exp(free) if p.null == 1.0 else free * p.scale, p.lower, p.upper))


def free_number(p: Parameter, value: float) -> float:
    """The free number behind a value of a parameter."""
    return float(np.log(value)) if p.null == 1.0 else value / p.scale
