"""Causes of a tap test: fitted together with the uncertain numbers, and named by the inference of all other readings (docs/theory.md V8).

Every effect that changes stiffness or mass may be at every place of the machine. A frequency bends with the size of an effect, so each
place has the changes by many sizes as its shapes.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import chdtrc

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.identification.candidates.candidates import Candidate
from stiffmap.identification.candidates.sensitivity import Variant
from stiffmap.identification.inference.chosen import Chosen
from stiffmap.identification.inference.columns import Columns, across
from stiffmap.identification.inference.constants import NOISE_SD, ODDS, RARE
from stiffmap.identification.inference.names import put_instead, searched
from stiffmap.identification.inference.optimum import Optimum, covariance, differences, optimum
from stiffmap.identification.inference.places import Place, shape_of
from stiffmap.identification.inference.verdict import judged
from stiffmap.identification.numbers.unknowns import Unknown
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
        return bool(chdtrc(len(self.lines.residual), self.chi2) > RARE)

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

    off = np.zeros(len(most)) if off is None else off
    start = np.r_[[free_number(p, value) for p, (_, value) in zip(numbers, begin, strict=True)], off]
    low = np.r_[[free_number(p, p.lower) for p in numbers], -most]
    high = np.r_[[free_number(p, p.upper) for p in numbers], most]
    fit = optimum(residual, start, (low, high), lambda x: differences(residual, x, STEP), STEPS)
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


FACTORS = (-1.5, -0.8, -0.4, -0.15, 0.15, 0.4, 0.8, 1.3, 1.8, 2.4)
"""Logarithms of a factor at which its changes are predicted."""
SIZES = (-10.0, -3.0, -1.0, 1.0, 3.0, 10.0, 30.0)
"""The same of a number whose null is zero, in typical sizes."""
BETWEEN = 16
"""Sizes from one of these to the next, both among them."""
REFINED = 4
"""Causes in the stead of one, and starts of the fit without any, that are fitted; effort only."""


def named_causes(problem: TapsProblem, tried: Sequence[Candidate], at: FittedCauses) -> list[Causes]:
    """Further causes that have a name where readings follow the uncertain numbers along straight lines from a fit, and what would
    do in the stead of each; all of them, and some, with the causes of the fit and without."""
    columns = columns_of(problem, tried, at)

    def predict(chosen: Sequence[Chosen]) -> Floats:
        try:
            there = problem.residual([*at.causes, *_values(chosen)], at.lines.x)
            return columns.rotated(there - at.lines.residual)
        except StiffmapError:
            return np.full(len(columns), np.nan)

    search = searched(columns, predict)
    named = judged(columns, search).named
    own = _values([n.chosen for n in named])
    sets = [own]
    for k, n in enumerate(named):
        instead = _values([put_instead(search.best.fit, n.chosen, p) for p in n.equivalents[:REFINED]])
        sets += [[*own[:k], v, *own[k + 1 :]] for v in instead]
    some = (part for s in sets for k in range(1, len(s) + 1) for part in combinations(s, k))
    both = (s for part in some for s in (part, (*at.causes, *part)))
    return list({frozenset(c for c, _ in s): s for s in both}.values())


def columns_of(problem: TapsProblem, tried: Sequence[Candidate], at: FittedCauses) -> Columns:
    """The readings, by their noise, as the inference takes them."""
    lines, taken = at.lines, [c for c, _ in at.causes]
    m = len(lines.residual)
    free = across(np.linalg.qr(at.own)[0])  # causes of the fit move with further ones
    residual = free.T @ (lines.jacobian @ lines.x - lines.residual)
    bare = Columns.bare(problem.plan, problem.row[problem.used], np.zeros(m, np.intp), free, residual)
    unknowns = tuple(Unknown(key, key.rpartition("/")[2], "", u) for key, _, u in problem.numbers)
    found = (place_of(problem, c, at, free) for c in tried if c not in taken)
    places = tuple(p for p in found if p.shapes)
    # as if repeats had shown the noise: a mode that is paired wrongly is none
    repeats = (0.5 / NOISE_SD**2,) * 2
    return replace(bare, unknowns=unknowns, numbers=free.T @ lines.jacobian, places=places, repeats=repeats)


def place_of(problem: TapsProblem, c: Candidate, at: FittedCauses, free: Floats) -> Place:
    """A candidate with the changes of the readings by its sizes, predicted at some and interpolated between them."""
    lines, p = at.lines, c.parameters[0]
    changes = {0.0: np.zeros(len(lines.residual))}
    for t in FACTORS if p.null == 1.0 else SIZES:
        with suppress(StiffmapError):
            if free_number(p, p.lower) < t < free_number(p, p.upper):
                changes[t] = problem.residual([*at.causes, (c, in_si(p, t))], lines.x) - lines.residual
    knots = sorted(changes)
    sizes = np.unique([np.linspace(*ends, BETWEEN) for ends in pairwise(knots)])
    found = CubicSpline(knots, [changes[t] for t in knots])(sizes) if len(knots) > 1 else ()
    shapes = []
    for t, change in zip(sizes, found, strict=True):
        step = (in_si(p, t) - float(p.null or 0.0)) / p.scale
        if step:
            line = change[None] / step
            shapes.append(shape_of(Variant(c, line, np.array([np.sign(step)])), free.T @ line.T))
    return Place(c, tuple(s for s in shapes if s is not None))


def _values(chosen: Sequence[Chosen]) -> Causes:
    """Causes with their values, SI, within their bounds."""
    every = ((c.place.candidate, *c.strengths[0]) for c in chosen)
    return [(cause, float(np.clip(value, p.lower, p.upper))) for cause, p, value in every]
