"""The corrected machine: named effects and uncertain numbers together, at their own nonlinear optimum.

With readings y, the prediction f of a machine with effects and numbers θ, frames and tools Φ where a machine stands, errors E e
along the drives' travel, and the covariance C of noise and of what nobody can name, the optimum is the least of

    |Q C^-½ (y - f(θ) - E e)|² + |z|² + |e|²,   Q = 1 - projection onto C^-½ Φ,

z the numbers in standard deviations of the search. Q is held, and taken anew where a fit ends (docs/theory.md I3). Bounded least
squares with a trust region: scipy.optimize.least_squares.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import compress

import numpy as np

from stiffmap.common.broadcasting import Mask
from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.noise.outliers import GROSS, MANY
from stiffmap.identification.inference.chosen import WIDE, Term
from stiffmap.identification.inference.constants import DEGREES, STANDS_OUT
from stiffmap.identification.inference.optimum import covariance, remembered, triangular
from stiffmap.identification.inference.readings import Readings
from stiffmap.identification.inference.travel import Profile, profiles
from stiffmap.identification.numbers.sensitivity import bends, moves_of, sensitivity_at, with_moves
from stiffmap.model.description import AppliedEffect
from stiffmap.solve.machine import Machine

STEP = 1e-3
"""Of a parameter's scale, for differences."""
STEPS, STEPS_OF_A_FOLD = 30, 3
"""Evaluations at most, of all readings and of those outside a fold."""
LITTLE = 1e-4
"""Of the squares, and of the size of all values: a change that ends a fit. Below it steps go to and fro, since the columns of
numbers are held."""
FRAMINGS, SETTLED = 4, 0.3
"""Fits with frames and tools where the machine of the last one stands, and their change, in noise, that ends them: within a fit
they are held, since a tool that hardly turns takes up another pattern with every small turn of the machine."""
WEIGHINGS = 3
"""Fits with weights of heavy tails."""
Effects = Callable[[Floats], Sequence[AppliedEffect]]
"""Effects with the values (k + p,) of an optimum."""


@dataclass(frozen=True, eq=False)
class Corrected:
    """A machine at the optimum, and what it shows."""

    terms: tuple[Term, ...]
    """At the optimum."""
    numbers: Floats
    """(p,) declared numbers, in standard uncertainties."""
    prediction: Floats
    """(n, c) m, rad."""
    slopes: Floats
    """(k, n, c) change of the prediction per scale of each value of the terms, m or rad; zero where the machine cannot be."""
    given: Readings
    """What it was fitted to, with the weights and the columns at the optimum."""
    travel: Floats = field(default_factory=lambda: np.zeros(0))
    """(K,) errors along the drives' travel, along the directions of their roots."""
    profiles: tuple[Profile, ...] = ()
    """The same over each drive's coordinate."""

    @property
    def refused(self) -> tuple[int, str] | None:
        """Number of an effect that has no name, and why: that which is least, if the 95 % intervals of all its strengths hold their
        null; one that a parameter which is not determined leaves without meaning."""
        far = [np.abs(t.values - t.nulls) / t.sd for t in self.terms]
        size = [np.inf if np.isnan(f).all() else float(np.nanmax(f)) for f in far]
        if min(size, default=np.inf) < WIDE:
            return size.index(min(size)), "its interval holds nothing at all"
        for k, t in enumerate(self.terms):
            for p in compress(t.candidate.parameters, t.undetermined):
                return k, f"these readings do not determine its {p.name}"
        return None

    @property
    def experiment(self) -> Experiment:
        """The readings, with frames and tools near where they fit best."""
        return self.given.predictor.experiment

    @property
    def others(self) -> Floats:
        """(p + K,) what is fitted besides the terms: numbers in standard deviations of the search, and errors along the travel."""
        return np.append(self.numbers / self.given.spread, self.travel)

    @property
    def effects(self) -> tuple[AppliedEffect, ...]:
        """With their values, SI."""
        return tuple(t.effect(t.values) for t in self.terms)


def without(found: Corrected, keep: Mask) -> Corrected:
    """The optimum of the readings in some rows (n,) alone, with the slopes of the whole: other readings move it by a part of a
    standard deviation."""
    return _optimum(found.given.only(keep), found.terms, found.others, found.slopes)


def instead(found: Corrected, terms: Sequence[Term]) -> Corrected:
    """The optimum with other terms under the same weights, from the same numbers."""
    return _determined(_optimum(found.given, terms, found.others))


def along_travel(found: Corrected, given: Readings) -> Corrected:
    """The optimum of readings whose drives err along their travel, next to effects that keep their values: what they leave."""
    more = corrected(given, (), found.effects)
    return replace(more, terms=found.terms, slopes=found.slopes)


def corrected(given: Readings, terms: Sequence[Term], fixed: Sequence[AppliedEffect] = ()) -> Corrected:
    """The optimum, from the values of the terms and the declared numbers, next to effects that are `fixed`."""
    found = _optimum(given, terms, fixed=fixed)
    for _ in range(WEIGHINGS):
        alone = given.predicted(found.numbers, ())
        if len(found.numbers) and bends(given.white, given.sensitivity, found.numbers, alone):
            anew = sensitivity_at(given.predictor, given.sensitivity, found.numbers)
            given = replace(given, sensitivity=anew)
            found = _optimum(given, found.terms, found.others, fixed=fixed)
        left = given.white(np.nan_to_num(given.predictor.experiment.reading - found.prediction))
        q = given.frames(found.prediction)
        noise = (
            given.rest.noise_part(left - q @ (q.T @ left)) * given.kappa**2 / given.weights / given.rest.noise
        )
        plain = bool(np.all(given.weights == 1.0))
        far = np.abs(noise) > (STANDS_OUT if plain else GROSS) * given.kappa
        if (plain and not far.any()) or far.mean() > MANY:  # many are no outliers
            break
        weights = (DEGREES + 1.0) / (DEGREES + (noise / given.kappa) ** 2)
        given = given.weighed(np.minimum(weights, 1.0))
        found = _optimum(given, found.terms, found.others, fixed=fixed)
    there = given.predictor.registered(found.prediction)
    if there is not given.predictor:  # frames and tools turn with the machine
        given = replace(found.given, predictor=there)
        found = _optimum(given, found.terms, found.others, fixed=fixed)
    return _determined(found)


def _determined(found: Corrected) -> Corrected:
    """The optimum without the parameters that effects can spare, left out one after the other: that which shows least first."""
    shown = _each(found.terms, np.array([np.linalg.norm(found.given.white(c)) for c in found.slopes]))
    least = [
        (float(c[j] * np.subtract(*t.bounds[::-1])[j]), k, int(j))
        for k, (t, c) in enumerate(zip(found.terms, shown, strict=True))
        for j in np.flatnonzero(t.spare)
    ]
    if not least:
        return found
    _, k, j = min(least)
    terms = [*found.terms[:k], found.terms[k].without(j), *found.terms[k + 1 :]]
    return _determined(_optimum(found.given, terms, found.others))


def _each(terms: Sequence[Term], x: Floats) -> list[Floats]:
    """The numbers of the terms at the head of x, one term after the other."""
    return np.split(x, np.cumsum([len(t.values) for t in terms]))[: len(terms)]


def _optimum(
    given: Readings,
    terms: Sequence[Term],
    others: Floats | None = None,
    held: Floats | None = None,
    fixed: Sequence[AppliedEffect] = (),
) -> Corrected:
    """The optimum under the weights of `given`, from the values of the terms and of all `others` (p + m,), None: zero, next to `fixed`
    effects; `held`: slopes (k, n, c) that are taken wherever the search stands, in place of those there."""
    steps = STEPS if held is None else STEPS_OF_A_FOLD
    e = given.predictor.experiment
    k, p = sum(len(t.values) for t in terms), len(given.spread)
    numbers_and_travel, along = -np.hstack([given.columns, given.along]), given.along
    m = along.shape[1]

    def effects(x: Floats) -> list[AppliedEffect]:
        return [*fixed, *(t.effect(v) for t, v in zip(terms, _each(terms, x), strict=True))]

    @remembered
    def at(x: Floats) -> Floats:
        return given.predicted(x[k:] * given.spread, effects(x))

    def shown(x: Floats) -> Floats:
        return at(x[: k + p])

    @remembered
    def slopes(x: Floats) -> Floats:
        if held is not None:
            return held
        each = [_change(given, x, j, high, at(x), effects, k) for j in range(k)]
        return np.array(each).reshape(k, *e.reading.shape)

    def raw(x: Floats) -> Floats:
        return given.white(e.reading - shown(x)) - along @ x[k + p :]

    def moving(x: Floats, q: Floats) -> Floats:
        left = raw(x)
        if not np.isfinite(left).all():
            return np.full((len(left) + p + m, k + 1), np.inf)
        of_terms = given.white(np.moveaxis(slopes(x[: k + p]), 0, -1))
        priors = np.hstack([np.zeros((p + m, k)), x[k:, None]])
        return np.vstack([_clear(np.column_stack([-of_terms, left]), q), priors])

    def held_columns(q: Floats) -> Floats:
        return np.vstack([_clear(numbers_and_travel, q), np.eye(p + m)])

    low = np.concatenate([*(t.bounds[0] for t in terms), np.full(p + m, -np.inf)])
    high = np.concatenate([*(t.bounds[1] for t in terms), np.full(p + m, np.inf)])
    begin = np.concatenate([*(t.values for t in terms), np.zeros(p + m) if others is None else others])
    inside = np.where(np.isfinite(high - low), 1e-9 * np.nan_to_num(high - low, posinf=0.0), 0.0)
    x = np.clip(begin, low + inside, high - inside)
    if not np.isfinite(raw(x)).all():
        raise StiffmapError("the machine has no equilibrium with the effects that were found")
    q = given.frames(shown(x))
    for _ in range(FRAMINGS if len(x) else 0):
        x = triangular(
            partial(moving, q=q), held_columns(q), x, (low, high), ftol=LITTLE, xtol=LITTLE, max_nfev=steps
        )
        left, before = raw(x), q
        q = given.frames(shown(x))
        if np.linalg.norm(before @ (before.T @ left) - q @ (q.T @ left)) < SETTLED:
            break
    spread = covariance(np.hstack([moving(x, q)[:, :k], held_columns(q)]))[0]
    numbers, travel = x[k : k + p] * given.spread, x[k + p :]
    found = profiles(given.drives, travel, spread[k + p :, k + p :])
    shows = given.predicted(numbers, effects(x), given.knots(found)) if found else shown(x)
    own = zip(terms, _each(terms, x), _each(terms, np.sqrt(np.diag(spread))), strict=True)
    at_best = tuple(replace(t, values=v, sd=sd) for t, v, sd in own)
    return Corrected(at_best, numbers, shows, slopes(x[: k + p]), given, travel, found)


def _clear(columns: Floats, directions: Floats) -> Floats:
    """(N, k) columns without what lies along orthonormal directions (N, q)."""
    return columns - directions @ (directions.T @ columns)


def columns_of(found: Corrected) -> tuple[Floats, Floats]:
    """(N, k + p + q) change of the readings, in noise, per unit of each effect's value, number and frame at an optimum, and (k + p +
    q,) the prior precision of these."""
    given = found.given
    columns = np.hstack([given.columns, given.along])
    frames = given.frames(found.prediction)
    effects = [given.white(c)[:, None] for c in found.slopes]
    whole = given.rest.coloured(np.hstack([*effects, columns, frames]))
    prior = [np.zeros(len(effects)), np.ones(columns.shape[1]), np.zeros(frames.shape[1])]
    return whole, np.concatenate(prior)


def _change(
    given: Readings, x: Floats, j: int, high: Floats, here: Floats, effects: Effects, k: int
) -> Floats:
    """(n, c) per scale of value j, by a one-sided difference; zero where the machine fails on both sides."""
    step = STEP * max(1.0, abs(float(x[j])))
    for h in (step, -step) if x[j] + step <= high[j] else (-step, step):
        moved = x.copy()
        moved[j] += h
        there = given.predicted(x[k:] * given.spread, effects(moved))
        if np.isfinite(there[given.rows, given.channel]).all():
            return np.asarray((there - here) / h)
    return np.zeros_like(here)


def machine_of(found: Corrected) -> Machine:
    """The machine that a file has: effects, and numbers that are not of a set-up or of the instrument."""
    given = found.given
    names = given.sensitivity.unknowns
    pairs = [(u, float(v)) for u, v in zip(names, found.numbers, strict=True) if not u.setup]
    p = given.predictor
    whole = with_moves(p.with_terms(found.effects).description, moves_of(pairs), given.knots(found.profiles))
    return Machine(whole, like=p.machine)
