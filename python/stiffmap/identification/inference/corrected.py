"""The corrected machine: named effects and uncertain numbers together, at their own nonlinear optimum.

With readings y, the prediction f of a machine with effects and numbers θ, frames and tools Φ where that machine stands,
and the covariance C = L Lᵀ of noise and of what nobody can name, the optimum is the least of

    |Q(θ) L⁻¹ (y - f(θ))|² + |z|²,   Q = 1 - projection onto L⁻¹ Φ(θ),

z the numbers in standard deviations of the search. Bounded least squares with a trust region: scipy.optimize.least_squares.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import norm

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Floats, Integers, Mask
from stiffmap.experiment.noise.nuisance import nuisance_columns
from stiffmap.experiment.noise.outliers import MANY
from stiffmap.experiment.noise.whitening import basis, readings_of
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.candidates.candidates import Candidate
from stiffmap.identification.inference.amplitudes import NOTHING, OFF, Fit
from stiffmap.identification.inference.columns import Columns, drawn, possible, zeros
from stiffmap.identification.inference.constants import DEGREES, STANDS_OUT
from stiffmap.identification.inference.covariance import Covariance, covariance
from stiffmap.identification.inference.kernels import Points, gaps
from stiffmap.identification.inference.travel import Drive, Profile, drives_of, knots_of, profiles
from stiffmap.identification.numbers.homing import zeros_anew
from stiffmap.identification.numbers.sensitivity import (
    Sensitivity,
    bends,
    predicted,
    sensitivity,
    sensitivity_at,
)
from stiffmap.identification.numbers.slopes import moves_of, with_moves
from stiffmap.identification.numbers.unknowns import Unknown, joint_name
from stiffmap.model.description import AppliedEffect
from stiffmap.model.description.tree import joints
from stiffmap.model.with_errors import Knots, edited
from stiffmap.solve.machine import Machine

MOST_FITTED = 9000
"""Readings that a machine is fitted to; of more, whole poses are drawn. Effort only."""
WIDE = float(norm.isf(0.025))
"""Standard deviations of a 95 % interval to either side."""
STEP = 1e-3
"""Of a parameter's scale, for differences."""
STEPS, STEPS_OF_A_FOLD = 30, 6
"""Evaluations at most, of all readings and of those outside a fold."""
FRAMINGS, SETTLED = 4, 0.3
"""Fits with frames and tools where the machine of the last one stands, and their change, in noise, that ends them: within a fit
they are held, since a tool that hardly turns takes up another pattern with every small turn of the machine."""
WEIGHINGS = 3
"""Fits with weights of heavy tails."""
Effects = Callable[[Floats], Sequence[AppliedEffect]]
"""Effects with the values (k + p,) of an optimum."""


@dataclass(frozen=True, eq=False)
class Term:
    """An effect that is fitted: all its parameters, in their scales."""

    candidate: Candidate
    values: Floats
    """(q,)."""

    @staticmethod
    def of(candidate: Candidate, term: AppliedEffect) -> Term:
        """With the values (SI) of an effect."""
        given = dict(term.parameters)
        found = [float(given.get(p.name, p.null or 0.0)) / p.scale for p in candidate.parameters]
        return Term(candidate, np.clip(np.array(found), *Term(candidate, np.zeros(0)).bounds))

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """(q,) least and largest values."""
        both = [possible(p) if p.null is not None else (p.lower, p.upper) for p in self.candidate.parameters]
        scale = np.array([p.scale for p in self.candidate.parameters])
        low, high = (np.array(side, dtype=float) / scale for side in zip(*both, strict=True))
        return low, high

    def effect(self, values: Floats) -> AppliedEffect:
        """With other values."""
        p = self.candidate.parameters
        return self.candidate.term([float(v) * q.scale for v, q in zip(values, p, strict=True)])


@dataclass(frozen=True, eq=False)
class Corrected:
    """A machine at the optimum, and what it shows."""

    terms: tuple[Term, ...]
    """At the optimum."""
    numbers: Floats
    """(p,) declared numbers, in standard uncertainties."""
    covariance: Floats
    """(k, k) of all values of the terms, in scales, one term after the other; numbers integrated out."""
    prediction: Floats
    """(n, c) m, rad."""
    given: Readings
    """What it was fitted to, with the weights and the columns at the optimum."""
    travel: Floats = field(default_factory=lambda: np.zeros(0))
    """(K,) errors along the drives' travel, along the directions of their roots."""
    profiles: tuple[Profile, ...] = ()
    """The same over each drive's coordinate."""

    @property
    def nothing(self) -> int | None:
        """Number of the effect that is least in its standard deviations, if the 95 % intervals of all its strengths hold their null."""
        sd = np.sqrt(np.maximum(np.diag(self.covariance), 1e-300))
        size, k = [], 0
        for t in self.terms:
            far = [
                abs(v - p.null / p.scale) / s
                for p, v, s in zip(t.candidate.parameters, t.values, sd[k:], strict=False)
                if p.null is not None
            ]
            size.append(max(far, default=np.inf))
            k += len(t.values)
        least = int(np.argmin(size)) if size else 0
        return least if size and size[least] < WIDE else None

    @property
    def effects(self) -> tuple[AppliedEffect, ...]:
        """With their values, SI."""
        return tuple(t.effect(t.values) for t in self.terms)


@dataclass(frozen=True, eq=False)
class Readings:
    """Readings that a machine is fitted to, with the covariance of what it does not explain."""

    predictor: Predictor
    sigma: Floats
    """(n, c) m, rad."""
    rows: Integers
    """(N,)."""
    channel: Integers
    """(N,)."""
    kappa: float
    """Noise over the declared one."""
    weights: Floats
    """(N,) of heavy tails."""
    rest: Covariance
    """Of what nobody can name, of common zeros and of effects without a name, and of the noise."""
    sensitivity: Sensitivity
    spread: Floats
    """(p,) standard deviation of each number, in standard uncertainties."""
    drives: tuple[tuple[Drive, Floats], ...] = ()
    """Drives that err along their travel, and the root (k, k) of the covariance at their knots, m² or rad²."""

    @cached_property
    def along(self) -> Floats:
        """(N, K) errors along the travel of all drives, whitened."""
        own = self.sigma[self.rows, self.channel][:, None]
        parts = [d.columns(self.rows, self.channel) @ r / own for d, r in self.drives]
        return self.rest.white(np.hstack([np.zeros((len(own), 0)), *parts]))

    @cached_property
    def columns(self) -> Floats:
        """(N, p) change of the readings per prior standard deviation of each number, whitened."""
        return self.white(self.sensitivity.columns) * self.spread

    def knots(self, found: Sequence[Profile]) -> dict[str, Knots]:
        """Axis positioning errors as a machine file has them."""
        of = joints(self.predictor.machine.description)
        return {p.drive: knots_of(of[joint_name(p.drive)], p) for p in found}

    def only(self, keep: Mask) -> Readings:
        """Those of some rows (n,)."""
        own = keep[self.rows]
        return replace(
            self,
            rows=self.rows[own],
            channel=self.channel[own],
            weights=self.weights[own],
            rest=self.rest.only(own),
        )

    def weighed(self, weights: Floats) -> Readings:
        """With other weights (N,)."""
        more = self.kappa**2 * (1.0 / weights - 1.0 / self.weights)
        return replace(self, weights=weights, rest=Covariance(self.rest.noise + more, self.rest.factor))

    def white(self, values: Floats) -> Floats:
        """(N, ...) of (n, c, ...), m or rad: whitened."""
        picked = values[self.rows, self.channel]
        return self.rest.white(
            picked / self.sigma[self.rows, self.channel].reshape(-1, *(1,) * (picked.ndim - 1))
        )

    def frames(self, prediction: Floats) -> Floats:
        """(N, q) orthonormal directions, whitened, of frames, tools and zeros where a machine stands that shows `prediction` (n, c)."""
        found = nuisance_columns(self.predictor.experiment, np.nan_to_num(prediction))
        return basis(self.white(found)) if found.shape[-1] else np.zeros((len(self.rows), 0))

    def predicted(
        self, numbers: Floats, effects: Sequence[AppliedEffect], travel: Mapping[str, Knots] | None = None
    ) -> Floats:
        """(n, c) m, rad; NaN where the machine cannot be."""
        p = self.predictor
        try:
            if travel:
                p = p.beside(machine=Machine(edited(p.machine.description, {}, travel), like=p.machine))
            return predicted(p, self.sensitivity.unknowns, numbers, effects)
        except StiffmapError:
            return np.full_like(self.sigma, np.nan)


def readings(
    predictor: Predictor,
    uncertain: Sequence[Unknown],
    columns: Columns,
    fit: Fit,
    sigma: Floats,
    suspects: Mask,
    without_name: Sequence[Floats] = (),
    exact: Sequence[Unknown] = (),
) -> Readings:
    """The readings of an experiment under the amplitudes of a fit.

    uncertain
        The numbers of the columns, and those that no reading shows.
    suspects
        (n,) rows that stand alone before any cause is known.
    without_name
        (n, c) m, rad: what effects of the fit that have no name add to the readings.
    exact
        Numbers that are as declared, since an effect speaks of them.
    """
    e = predictor.experiment
    rows, channel = readings_of(e, predictor())
    kept = drawn(e.groups[rows], 0, MOST_FITTED)
    rows, channel = rows[kept], channel[kept]
    own = sigma[rows, channel]
    points = Points(rows, channel, own)
    some = Points(columns.rows, columns.channel, columns.sigma)
    amplitude = {p.name: float(np.exp(t)) for p, t in zip(fit.parts, fit.t[1:], strict=True) if t > OFF}
    kernels = [
        (k, amplitude[k.name] * scale)
        for k in gaps(predictor.machine, e, some)
        if k.name in amplitude and (scale := columns.scale_of(k)) > 0.0
    ]
    patterns = [np.nan_to_num(change[rows, channel])[:, None] / own[:, None] for change in without_name]
    weights = np.full(sigma.shape, 1.0)
    weights[suspects] = NOTHING
    weights[columns.rows, columns.channel] = fit.weights
    weights = weights[rows, channel]
    rest = covariance(points, some, kernels, fit.noise**2 / weights, np.hstack([zeros(e, points), *patterns]))
    size = {k: fit.spread(group) for group, index in columns.groups.items() for k in index}
    known = [(u, size[k]) for k, u in enumerate(columns.unknowns) if u not in exact]
    unknowns = tuple(u for u, s in known if s > 0.0)
    s = sensitivity(predictor, uncertain)
    s = zeros_anew(s, e) or s
    drives = tuple(_erring(predictor, s, columns, amplitude)) if columns.travel else ()
    index = [s.unknowns.index(u) for u in unknowns]
    s = replace(s, unknowns=unknowns, columns=s.columns[..., index])
    return Readings(
        predictor,
        sigma,
        rows,
        channel,
        fit.noise,
        weights,
        rest,
        s,
        np.array([size for _, size in known if size > 0.0]),
        drives,
    )


def _erring(
    predictor: Predictor, s: Sensitivity, columns: Columns, amplitude: Mapping[str, float]
) -> Iterator[tuple[Drive, Floats]]:
    """Drives that err along their travel in a fit, with the roots at their knots; `amplitude`: variances of its parts, in noise."""
    variance = {name: amplitude[name] * sd**2 for name, _, sd in columns.travel if name in amplitude}
    for drive in drives_of(predictor, s):
        if any(name in variance for name, _ in drive.names()):
            yield drive, drive.root(variance)


def corrected(
    given: Readings, terms: Sequence[Term], start: Corrected | None = None, steps: int = STEPS
) -> Corrected:
    """The optimum, from the values of the terms and the declared numbers, or from another optimum."""
    found = _optimum(given, terms, start, steps)
    if start is not None:
        return found
    for _ in range(WEIGHINGS):
        if _bends(given, found):
            anew = sensitivity_at(given.predictor, given.sensitivity, found.numbers)
            given = replace(given, sensitivity=anew)
            found = _optimum(given, terms, found, steps)
        left = given.white(np.nan_to_num(given.predictor.experiment.reading - found.prediction))
        q = given.frames(found.prediction)
        noise = (
            given.rest.noise_part(left - q @ (q.T @ left)) * given.kappa**2 / given.weights / given.rest.noise
        )
        far = np.abs(noise) > STANDS_OUT * given.kappa
        if np.all(given.weights == 1.0) and not 0.0 < far.mean() <= MANY:  # many are no outliers
            break
        weights = (DEGREES + 1.0) / (DEGREES + (noise / given.kappa) ** 2)
        given = given.weighed(np.minimum(weights, 1.0))
        found = _optimum(given, terms, found, steps)
    return found


def _parts(terms: Sequence[Term], x: Floats) -> tuple[Term, ...]:
    """The terms with the values at the head of x, one term after the other."""
    ends = np.cumsum([0, *(len(t.values) for t in terms)])
    return tuple(replace(t, values=x[a:b]) for t, a, b in zip(terms, ends[:-1], ends[1:], strict=True))


def _optimum(given: Readings, terms: Sequence[Term], start: Corrected | None, steps: int) -> Corrected:
    e = given.predictor.experiment
    terms = tuple(terms) if start is None else start.terms
    k, p = sum(len(t.values) for t in terms), len(given.spread)
    columns, along = given.columns, given.along
    m = along.shape[1]
    known: dict[bytes, Floats] = {}

    def effects(x: Floats) -> list[AppliedEffect]:
        return [t.effect(t.values) for t in _parts(terms, x)]

    def shown(x: Floats) -> Floats:
        x = x[: k + p]
        key = x.tobytes()
        if key not in known:
            known.clear()
            known[key] = given.predicted(x[k:] * given.spread, effects(x))
        return known[key]

    def raw(x: Floats) -> Floats:
        return given.white(e.reading - shown(x)) - along @ x[k + p :]

    def residual(x: Floats, q: Floats) -> Floats:
        left = raw(x)
        if not np.isfinite(left).all():
            return np.full(len(left) + p + m, np.inf)
        return np.append(left - q @ (q.T @ left), x[k:])

    def jacobian(x: Floats, q: Floats) -> Floats:
        each = [_change(given, x[: k + p], j, high, shown(x), effects, k) for j in range(k)]
        whole = -np.column_stack([*(given.white(c) for c in each), columns, along])
        whole -= q @ (q.T @ whole)
        return np.vstack([whole, np.hstack([np.zeros((p + m, k)), np.eye(p + m)])])

    low = np.concatenate([*(t.bounds[0] for t in terms), np.full(p + m, -np.inf)])
    high = np.concatenate([*(t.bounds[1] for t in terms), np.full(p + m, np.inf)])
    begin = np.concatenate([*(t.values for t in terms), np.zeros(p + m)])
    if start is not None:
        begin[k:] = np.append(start.numbers / given.spread, start.travel)
    inside = np.where(np.isfinite(high - low), 1e-9 * np.nan_to_num(high - low, posinf=0.0), 0.0)
    x = np.clip(begin, low + inside, high - inside)
    if not np.isfinite(raw(x)).all():
        raise StiffmapError("the machine has no equilibrium with the effects that were found")
    q = given.frames(shown(x))
    for _ in range(FRAMINGS if len(x) else 0):
        x = least_squares(
            lambda x, q=q: residual(x, q),
            x,
            lambda x, q=q: jacobian(x, q),
            (low, high),
            x_scale="jac",
            ftol=1e-6,
            xtol=1e-6,
            max_nfev=steps,
        ).x
        left, before = raw(x), q
        q = given.frames(shown(x))
        if np.linalg.norm(before @ (before.T @ left) - q @ (q.T @ left)) < SETTLED:
            break
    j = jacobian(x, q)
    spread: Floats = np.asarray(np.linalg.pinv(j.T @ j, rcond=1e-12, hermitian=True))
    numbers, travel = x[k : k + p] * given.spread, x[k + p :]
    found = profiles(given.drives, travel, spread[k + p :, k + p :])
    shows = given.predicted(numbers, effects(x), given.knots(found)) if found else shown(x)
    return Corrected(_parts(terms, x), numbers, np.asarray(spread[:k, :k]), shows, given, travel, found)


def columns_of(found: Corrected) -> tuple[Floats, Floats]:
    """(N, k + p + q) change of the readings, in noise, per unit of each effect's value, number and frame at an optimum, and (k + p +
    q,) the prior precision of these."""
    given = found.given
    x = np.concatenate([*(t.values for t in found.terms), found.numbers / given.spread])
    k = len(x) - len(given.spread)
    high = np.concatenate([*(t.bounds[1] for t in found.terms), np.full(len(given.spread), np.inf)])

    def effects(at: Floats) -> list[AppliedEffect]:
        return [t.effect(t.values) for t in _parts(found.terms, at)]

    each = [_change(given, x, j, high, found.prediction, effects, k) for j in range(k)]
    columns = np.hstack([given.columns, given.along])
    frames = given.frames(found.prediction)
    whole = given.rest.coloured(np.hstack([*(given.white(c)[:, None] for c in each), columns, frames]))
    return whole, np.concatenate([np.zeros(k), np.ones(columns.shape[1]), np.zeros(frames.shape[1])])


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


def _bends(given: Readings, found: Corrected) -> bool:
    """Whether the numbers' columns at the optimum are others than those in use."""
    if not len(found.numbers):
        return False
    alone = given.predicted(found.numbers, ())
    if not np.isfinite(alone[given.rows, given.channel]).all():
        return False
    return bends(given.white, given.sensitivity, found.numbers, alone, 1.0)


def machine_of(found: Corrected) -> Machine:
    """The machine that a file has: effects, and numbers that are not of a set-up or of the instrument."""
    given = found.given
    names = given.sensitivity.unknowns
    pairs = [(u, float(v)) for u, v in zip(names, found.numbers, strict=True) if not u.setup]
    p = given.predictor
    whole = with_moves(p.with_terms(found.effects).description, moves_of(pairs), given.knots(found.profiles))
    return Machine(whole, like=p.machine)
