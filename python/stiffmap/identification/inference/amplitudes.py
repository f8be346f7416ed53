"""All amplitudes of one model at once: restricted likelihood with priors, maximised by average information.

The model of m residuals r in noise is r ~ N(0, V),

    V = κ² N(w) + Z + Σ exp(t_k) M_k,   N(w) = Bᵀ diag(1/w) B,

with B what unknown frames leave of the readings, w the weights of heavy tails, Z the declared zeros, and one M_k for each
group of declared numbers, each gap and each effect. Gilmour, Thompson, Cullis, Biometrics 51 (1995) 1440; heavy tails as
the bound of a scale mixture: Lange, Little, Taylor, JASA 84 (1989) 881.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.linalg import LinAlgError
from scipy.linalg import cho_solve, cholesky, solve_triangular
from scipy.linalg.blas import daxpy, dsyrk
from scipy.linalg.lapack import dpotri
from scipy.special import gammaln

from stiffmap.experiment.experiment import Floats
from stiffmap.identification.inference.columns import Columns
from stiffmap.identification.inference.constants import (
    DEGREES,
    FEWEST_REPEATS,
    NOISE_SD,
    SHRINK,
    STANDS_OUT,
    WIDEST,
)
from stiffmap.identification.inference.parts import ALL_NUMBERS, GAPS, NOISE, Part, of_size

STEPS, LARGEST_STEP, ENOUGH = 30, 2.0, 0.01
"""Newton steps, their length in ln variance, and the gain of evidence that ends them."""
WEIGHINGS = 40
"""Of heavy tails, at most, each followed by a few Newton steps."""
CATCHES_UP = 10.0
"""Evidence, ln, that heavy tails may gain over none by an effect more; effort only."""
NOTHING = 1e-6
"""Weight of a reading that stands alone, to begin with."""
WEIGHED, REACH = 0.1, 10.0
"""Gain of evidence that ends the weighings; how often what one gains may be to come, effort only."""
OFF, SINKS = -14.0, -8.0
"""ln variance of a part that the readings do not ask for, and below which one on its way down is taken out."""
ROUND_OFF = 1e-13
"""Of the largest variance: what is added to the diagonal where a covariance cannot be factorised."""
BEGIN, QUIET = -2.0, -6.0
"""ln variance with which a part begins, and what nobody can name where it may be noise instead."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A model at its best amplitudes."""

    columns: Columns
    parts: tuple[Part, ...]
    t: Floats
    """(1 + k,) ln variances: of the noise, then of the parts."""
    weights: Floats
    """(N,) of heavy tails; all 1 without."""
    root: Floats
    """(m, m) lower Cholesky factor of V."""
    solved: Floats
    """(m,) V⁻¹ r."""
    likelihood: float
    """ln N(r | 0, V), with the bound of heavy tails."""
    score: float
    """Evidence: likelihood, priors, and the price of the amplitudes (Laplace)."""
    lighter: float = 0.0
    """How much likelier than with heavy tails, ln; 0 where none were tried."""
    gain: dict[int, Floats] = field(default_factory=dict)
    """What places would add to the evidence, as far as it was asked for: by the place's `id`, (shapes,)."""

    @property
    def noise(self) -> float:
        """κ: noise over what is declared."""
        return float(np.exp(0.5 * self.t[0]))

    @property
    def heavy(self) -> bool:
        """Whether the noise has heavy tails: some readings lie far from the others and count less."""
        return bool(np.any(self.weights != 1.0))

    @property
    def amplitudes(self) -> dict[str, float]:
        """ln variances, by the names of the noise and of the parts."""
        return dict(zip([NOISE, *(p.name for p in self.parts)], self.t.tolist(), strict=True))

    def amplitude(self, name: str) -> float:
        """Standard deviation of a part; 0 where it is not in the model."""
        return float(np.exp(0.5 * self.amplitudes.get(name, -np.inf)))

    @property
    def on(self) -> list[tuple[Part, float]]:
        """Parts that the readings ask for, with their ln variances."""
        return [(p, float(self.t[k])) for k, p in _on(self.parts, self.t).items()]

    def spread(self, group: str) -> float:
        """Standard deviation of the numbers of a group, in standard uncertainties: its own, or that of all together."""
        return self.amplitude(group if group in self.amplitudes else ALL_NUMBERS)

    def mean(self, part: Part) -> Floats:
        """(m,) posterior mean of what a part of the model adds to the readings."""
        k = [p.name for p in self.parts].index(part.name)
        return np.asarray(np.exp(self.t[1 + k]) * part.times(self.solved))

    def white(self, values: Floats) -> Floats:
        """(m, ...) L⁻¹ values."""
        return np.asarray(solve_triangular(self.root, values, lower=True, check_finite=False))

    @cached_property
    def at_readings(self) -> Floats:
        """(N,) information of each reading: the diagonal of B V⁻¹ Bᵀ."""
        return np.asarray(np.sum(self.white(self.columns.free.T) ** 2, axis=0))

    def without(self, names: Sequence[str], noise: float | None = None) -> Fit:
        """The same with some parts taken away, nothing fitted anew; `noise`: κ of the result."""
        kept = [k for k, p in enumerate(self.parts) if p.name not in names]
        parts = tuple(self.parts[k] for k in kept)
        t = np.array([self.t[0] if noise is None else 2.0 * np.log(noise), *self.t[1:][kept]])
        return evaluated(self.columns, parts, t, self.weights)


def fitted(
    columns: Columns,
    parts: Sequence[Part],
    start: Mapping[str, float] | None = None,
    weights: Floats | None = None,
    lighter: float = 0.0,
) -> Fit:
    """The amplitudes of the best evidence; heavy tails where a reading stands out and the bound is better without doubt. A reading
    that is far off may be all that a gap explains, so those that stand alone of a robust fit begin with no weight, and
    a fit from nothing begins with next to no gap as well.

    start
        ln variances to begin with, by the name of the part; others begin small.
    weights
        (N,) of heavy tails of a fit that this one goes on from: no others are tried.
    lighter
        How much likelier that fit was than with heavy tails, ln; none are tried where one effect more can hardly change that.
    """
    given = start or {}
    first = np.array([given.get(NOISE, 0.0), *(given.get(p.name, BEGIN) for p in parts)])
    light = _optimum(columns, tuple(parts), first, np.ones(len(columns.rows)))
    if weights is not None and np.any(weights != 1.0):
        heavy = _optimum(columns, tuple(parts), first, weights, heavy=True, beat=light.score)
        return max(light, heavy, key=lambda f: f.score)
    if lighter > CATCHES_UP:
        return replace(light, lighter=lighter - CATCHES_UP)
    typical, slips = _standing_out(light)
    begun = np.array([2.0 * np.log(typical), *first[1:]])  # what sank may rise
    starts = [(begun, slips)]
    if not given:  # what nobody can name may have taken what stands out
        quiet = np.where([False, *(p.kind in (*GAPS, "time") for p in parts)], QUIET, begun)
        starts.append((quiet, _standing_out(evaluated(columns, parts, quiet, light.weights))[1]))
    if columns.alone.any():
        starts.append((begun, np.where(columns.alone, NOTHING, 1.0)))
    scores, best = [], light
    for t, w in starts:
        if w is not None:
            heavy = _optimum(columns, tuple(parts), t, w, heavy=True, beat=best.score)
            scores.append(heavy.score)
            best = max(best, heavy, key=lambda f: f.score)
    return replace(best, lighter=best.score - max(scores)) if scores else best


def _standing_out(fit: Fit) -> tuple[float, Floats | None]:
    """Robust standard deviation of the noise, at most the fit's, and (N,) weights of heavy tails at its posterior; None where no reading
    stands out."""
    mean, sd = noise_part(fit)
    typical = min(fit.noise, 1.4826 * float(np.median(np.abs(mean))))
    return typical, _heavy(fit, mean, sd) if np.any(np.abs(mean) > STANDS_OUT * typical) else None


def refitted(fit: Fit, residual: Floats) -> Fit:
    """The same parts for another residual (m,): from the amplitudes of a fit, with heavy tails where it has them."""
    columns = replace(fit.columns, residual=residual)
    found = _optimum(columns, fit.parts, fit.t, fit.weights, heavy=fit.heavy)
    return replace(found, lighter=fit.lighter)


def _heavy(fit: Fit, mean: Floats, sd: Floats) -> Floats:
    """(N,) weights of heavy tails at the posterior of the noise, its mean and standard deviation (N,)."""
    label, size, _ = fit.columns.tails
    squares = np.bincount(label, (mean**2 + sd**2) / fit.noise**2)
    return np.asarray(((DEGREES + size) / (DEGREES + squares))[label])


def evaluated(columns: Columns, parts: Sequence[Part], t: Floats, weights: Floats) -> Fit:
    """The evidence at given amplitudes."""
    fit, along = _evaluate(columns, tuple(parts), t, weights, columns.of_noise(weights))
    return _priced(fit, _price(fit, _information(fit, along)))


def declared_noise(columns: Columns) -> tuple[float, float]:
    """Mean and standard deviation of ln κ² before the readings are compared with the machine: by repeats, or as declared."""
    if not _known_by_repeats(columns):
        return 0.0, 2.0 * NOISE_SD
    squares, freedom = columns.repeats
    return float(np.log(squares / freedom)), 2.0 / float(np.sqrt(2.0 * freedom))


def noise_prior(columns: Columns, t: float) -> float:
    """ln density of ln κ² before that, over the one of its centre: Gaussian, but Cauchy's above a declaration, which may be short of
    the noise by any factor."""
    centre, sd = declared_noise(columns)
    square = ((t - centre) / sd) ** 2
    return -float(np.log1p(square)) if _beyond_declared(columns, t) else -0.5 * square


def _beyond_declared(columns: Columns, t: float) -> bool:
    return t > 0.0 and not _known_by_repeats(columns)


def _known_by_repeats(columns: Columns) -> bool:
    squares, freedom = columns.repeats
    return freedom >= FEWEST_REPEATS and squares > 0.0


def noise_part(f: Fit) -> tuple[Floats, Floats]:
    """(N,) posterior mean and standard deviation of the noise of each reading."""
    variance = f.noise**2 / f.weights
    back = f.columns.free @ f.solved
    return variance * back, np.sqrt(np.maximum(variance - variance**2 * f.at_readings, 0.0))


def _evaluate(
    columns: Columns, parts: tuple[Part, ...], t: Floats, weights: Floats, noise: Floats
) -> tuple[Fit, Floats]:
    """The fit at these amplitudes without their price, and (m, 1 + k) what each part adds to the readings; parts that are off add
    nothing."""
    variance = np.exp(t)
    on = _on(parts, t)
    v = np.asfortranarray(variance[0] * noise.T)
    for a, full in [
        (1.0, columns.zero),
        *((variance[k], p.full) for k, p in on.items() if p.full is not None),
    ]:
        daxpy(full.reshape(-1), v.T.reshape(-1), a=a)  # symmetric all, in place: as the lower half lies
    short = [np.sqrt(variance[k]) * p.factor for k, p in on.items() if p.factor is not None]
    if short:  # the lower half only
        v = dsyrk(1.0, np.hstack(short), beta=1.0, c=v, lower=1, overwrite_c=1)
    root = _root(v)
    r = columns.residual
    solved = cho_solve((root, True), r, check_finite=False)
    m = len(r)
    likelihood = -0.5 * float(r @ solved) - float(np.log(np.diag(root)).sum()) - 0.5 * m * np.log(2 * np.pi)
    likelihood += _bound(columns, weights)
    along = np.zeros((m, len(t)), order="F")
    along[:, 0] = variance[0] * (columns.free.T @ ((columns.free @ solved) / weights))
    for k, p in on.items():
        along[:, k] = variance[k] * p.times(solved)
    sd = np.array([p.sd for p in parts])
    score = likelihood + noise_prior(columns, float(t[0])) - 0.5 * float(np.sum((t[1:] / sd) ** 2))
    return Fit(columns, parts, t, weights, root, solved, likelihood, score), along


def _on(parts: tuple[Part, ...], t: Floats) -> dict[int, Part]:
    """Parts that are not off, by their places in t."""
    return {k: p for k, p in enumerate(parts, 1) if t[k] > OFF}


def _gradient(fit: Fit, along: Floats) -> Floats:
    """(1 + k,) slope of the score, priced without. Traces of V⁻¹ with all parts of V sum to m, which gives that of the noise."""
    trace, on, variance = np.zeros(len(fit.t)), _on(fit.parts, fit.t), np.exp(fit.t)
    short = {k: p.factor for k, p in on.items() if p.factor is not None}
    if short:
        squares = np.sum(fit.white(np.hstack(list(short.values()))) ** 2, axis=0)
        ends = np.cumsum([f.shape[1] for f in short.values()])
        trace[list(short)] = [x.sum() for x in np.split(squares, ends[:-1])]
    whole, zero = {k: p.full for k, p in on.items() if p.full is not None}, 0.0
    if whole or fit.columns.zero.any():
        inverse = np.asarray(dpotri(fit.root, lower=1)[0])  # its lower half; zero above the diagonal
        diagonal = np.diag(inverse)
        for k, full in whole.items():
            trace[k] = 2.0 * np.vdot(inverse.T, full) - diagonal @ np.diag(full)
        zero = 2.0 * np.vdot(inverse.T, fit.columns.zero) - diagonal @ np.diag(fit.columns.zero)
    trace[0] = (len(fit.columns) - zero - variance[1:] @ trace[1:]) / variance[0]
    centre, sd = _prior(fit)
    slope = along.T @ fit.solved - variance * trace
    return np.asarray(0.5 * slope - (fit.t - centre) / sd**2)


def _information(fit: Fit, along: Floats) -> Floats:
    """(1 + k, 1 + k) average information, priors included."""
    _, sd = _prior(fit)
    white = fit.white(along)
    return np.asarray(0.5 * white.T @ white + np.diag(1.0 / sd**2))


def _prior(fit: Fit) -> tuple[Floats, Floats]:
    """(1 + k,) means and standard deviations of ln variances before any reading; of the noise, as its heavy tails weigh it here."""
    mean, sd = declared_noise(fit.columns)
    if _beyond_declared(fit.columns, float(fit.t[0])):
        sd *= np.sqrt(0.5 * (1.0 + ((fit.t[0] - mean) / sd) ** 2))
    return np.array([mean, *np.zeros(len(fit.parts))]), np.array([sd, *(p.sd for p in fit.parts)])


def _price(fit: Fit, information: Floats) -> float:
    """What the amplitudes cost that are no effects' (Laplace)."""
    _, sd = _prior(fit)
    wide = np.minimum(sd, WIDEST)
    wide[0] = declared_noise(fit.columns)[1]
    counted = np.array([True, *(p.kind != "effect" for p in fit.parts)])
    of_data = information - np.diag(1.0 / sd**2)
    some = (wide[:, None] * of_data * wide)[np.ix_(counted, counted)]
    return 0.5 * float(np.linalg.slogdet(np.eye(int(counted.sum())) + some)[1])


def _priced(fit: Fit, price: float) -> Fit:
    """The evidence: less the price of the amplitudes, the mean over sizes of each effect."""
    score = fit.score - price
    for p, x in zip(fit.parts, fit.t[1:], strict=True):
        if p.kind == "effect":
            assert p.factor is not None
            score += of_size(p.factor, fit.root, fit.solved, float(x))
    return replace(fit, score=score)


def _root(v: Floats) -> Floats:
    """Lower Cholesky factor; with as little more on the diagonal as round-off needs where one part is far larger than the noise."""
    more = 0.0
    while True:
        try:
            return np.asarray(cholesky(v, lower=True, check_finite=False))
        except LinAlgError:
            more = max(9.0 * more, ROUND_OFF * float(np.diag(v).max()))
            v = v + more * np.eye(len(v))


def _bound(columns: Columns, weights: Floats) -> float:
    """What the bound of heavy tails adds to a Gaussian of variances κ²/w; 0 where all weights are 1."""
    if np.all(weights == 1.0):
        return 0.0
    _, d, first = columns.tails
    n, w = DEGREES, weights[first]
    constant = (
        gammaln((n + d) / 2.0)
        - gammaln(n / 2.0)
        - 0.5 * d * np.log(n * np.pi)
        + 0.5 * d * np.log(2.0 * np.pi)
    )
    each = constant - 0.5 * d * np.log(w) - 0.5 * (n + d) * np.log((n + d) / (w * n)) + 0.5 * (n + d - n * w)
    return float(each.sum())


def _optimum(
    columns: Columns,
    parts: tuple[Part, ...],
    t: Floats,
    weights: Floats,
    *,
    heavy: bool = False,
    beat: float = -np.inf,
) -> Fit:
    """Damped Newton steps on ln variances; `heavy`: then further ones, each together with the weights of heavy tails at the posterior
    before it, which by itself never makes the bound less, as long as the evidence to `beat` is within their reach."""
    if heavy:
        begun = _optimum(columns, parts, t, weights)
        t, weights = begun.t, _heavy(begun, *noise_part(begun))
    damping, noise = SHRINK, columns.of_noise(weights)
    most = np.array([np.inf, *(p.most for p in parts)])
    t = np.minimum(t, most)
    fit, along = _evaluate(columns, parts, t, weights, noise)
    gradient, information = None, _information(fit, along)
    price = _price(fit, information)
    for _ in range(WEIGHINGS if heavy else STEPS):
        if gradient is None:
            gradient = _gradient(fit, along)
            if heavy:
                weights = _heavy(fit, *noise_part(fit))
                noise = columns.of_noise(weights)
        scale = np.maximum(np.diag(information), 1e-2)
        free = np.flatnonzero((fit.t < most) | (gradient < 0.0))
        step = np.zeros(len(t))
        step[free] = np.linalg.solve(
            (information + damping * np.diag(scale))[np.ix_(free, free)], gradient[free]
        )
        step = np.clip(step, -LARGEST_STEP, np.minimum(LARGEST_STEP, most - fit.t))
        sinks = (fit.t + step < SINKS) & (step < 0.0)
        moved, along_there = _evaluate(columns, parts, np.where(sinks, OFF, fit.t + step), weights, noise)
        gain = moved.score - fit.score
        if gain < -1e-9:
            damping *= 8.0
            if damping > 1e6:
                break
            continue
        fit, along, gradient = moved, along_there, None
        information = _information(fit, along)
        damping = max(damping / 4.0, 1e-3)
        before, price = price, _price(fit, information)
        if (
            max(gain, gain + before - price) < (WEIGHED if heavy else ENOUGH)
            or fit.score + REACH * gain < beat
        ):
            break
    return _priced(fit, price)
