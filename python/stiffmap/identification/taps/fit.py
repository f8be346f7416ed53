"""Causes of a tap test that are fitted together with the uncertain numbers of the machine file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from stiffmap.common.broadcasting import Floats
from stiffmap.identification.candidates.candidates import Candidate
from stiffmap.identification.inference.constants import ODDS, RARE
from stiffmap.identification.inference.optimum import Optimum, covariance
from stiffmap.identification.taps.causes import Causes, scaled, together, unscaled
from stiffmap.identification.taps.problem import TapsProblem
from stiffmap.solve.machine import Machine


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

    def by(self, statics: Explained | None = None, taps: Explained | None = None) -> Explained:
        """With its parameter by static readings alone and by frequencies alone, where there are both and each determines it."""
        if statics is None or taps is None:
            return self
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
    """Causes near their values with the uncertain numbers free, which are not taken to be small."""
    scales = [scaled(c.parameters[0]) for c, _ in begin]

    def at(x: Floats) -> Causes:
        return [(c, to(float(t))) for (c, _), (to, *_), t in zip(begin, scales, x, strict=True)]

    fit = problem.settled(
        [unscaled(c.parameters[0], value) for c, value in begin],
        lambda x: together(at(x)),
        [low for _, low, _ in scales],
        [high for *_, high in scales],
        off,
    )
    k, n = len(begin), int(problem.used.sum())
    found = []
    for (c, value), variance in zip(at(fit.x[:k]), np.diag(covariance(fit.jacobian)[0])[:k], strict=True):
        p = c.parameters[0]
        u = float(np.sqrt(variance)) * (value if p.null == 1.0 else p.scale)
        found.append(Explained(c, {p.name: value}, {p.name: u}, fit.chi2))
    machine, _ = problem.real(together(at(fit.x[:k])), fit.x[k:])
    slopes = fit.jacobian[:n]
    lines = Optimum(fit.x[k:], fit.residual[:n], slopes[:, k:])
    return FittedCauses(tuple(found), fit.chi2, machine, lines, slopes[:, :k])
