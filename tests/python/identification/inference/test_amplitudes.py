"""The evidence of one covariance against dense formulas, its slopes against differences."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import cauchy, multivariate_normal, multivariate_t, norm
from tests.python.identification.inference.synthetic import READINGS, columns, parts

from stiffmap.identification.inference import amplitudes
from stiffmap.identification.inference.constants import DEGREES, NOISE_SD, NUMBERS_SD, SIZES, WIDEST
from stiffmap.identification.inference.shares import shares


def test_lengths_and_angles_of_a_row_slip_each_together():
    c = replace(columns(np.random.default_rng(0)), rows=np.array([4, 4, 4, 7, 7]), tied=True)
    label, size, first = replace(c, channel=np.array([0, 1, 0, 1, 1])).tails
    assert list(label) == [0, 1, 0, 2, 2] and list(size) == [2, 1, 2] and list(first) == [0, 1, 3]


def dense(c, some, ln_variance, weights):
    """V by its definition."""
    noise = c.free.T @ np.diag(1.0 / weights) @ c.free
    v = c.zero + np.exp(ln_variance[0]) * noise
    for p, x in zip(some, ln_variance[1:], strict=True):
        v = v + np.exp(x) * (p.full if p.full is not None else p.factor @ p.factor.T)
    return v


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("heavy", ["", "own", "tied"])
def test_the_likelihood_is_that_of_the_covariance_and_its_gradient_that_of_differences(seed, heavy):
    rng = np.random.default_rng(seed)
    c, some = columns(rng), parts(rng)
    if heavy == "tied":
        c = replace(c, rows=np.arange(READINGS) // 3, tied=True)
    label, size, _ = c.tails
    each = rng.uniform(0.2, 1.2, len(size)) if heavy else np.ones(len(size))
    w = each[label]
    at = rng.uniform(-1.5, 1.0, 4)
    noise = c.of_noise(w)

    def objective(x):
        return amplitudes._evaluate(c, some, x, w, noise)

    fit, along = objective(at)
    gradient = amplitudes._gradient(fit, along)
    information = amplitudes._information(fit, along)
    expected = multivariate_normal(cov=dense(c, some, at, w)).logpdf(c.residual)
    gaussian = sum(norm.logpdf(0.0, scale=w**-0.5))
    bound = sum(map(ln_bound, np.zeros(len(size)), each, size)) - gaussian if heavy else 0.0
    assert fit.likelihood == pytest.approx(expected + bound, abs=1e-8)
    inside = c.free @ np.linalg.inv(dense(c, some, at, w)) @ c.free.T
    np.testing.assert_allclose(fit.at_readings, np.diag(inside), rtol=1e-10)
    errors = []
    for h in (1e-2, 5e-3):
        steps = h * np.eye(4)
        differences = [(objective(at + s)[0].score - objective(at - s)[0].score) / (2 * h) for s in steps]
        errors.append(np.abs(differences - gradient).max())
    assert errors[1] < 1e-3
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.3)
    assert np.linalg.eigvalsh(information).min() > 0.0


def ln_t(e, d):
    """ln of Student's t of d readings whose squares sum to e**2."""
    at = np.asarray(e)[..., None] * np.eye(d)[0]
    return multivariate_t.logpdf(at, loc=np.zeros(d), shape=np.eye(d), df=DEGREES)


def ln_bound(e, w, d):
    """Tangent of ln t of d readings at the deviation whose weight is w, as a Gaussian of variances 1/w."""
    x0 = (DEGREES + d) / w - DEGREES
    return ln_t(0.0, d) - (DEGREES + d) / 2 * np.log1p(x0 / DEGREES) - w / 2 * (e**2 - x0)


@pytest.mark.parametrize("d", [1, 3])
def test_the_bound_of_heavy_tails_lies_below_them_and_touches_them(d):
    e = np.linspace(-8, 8, 161)
    c = replace(columns(np.random.default_rng(0)), rows=np.arange(2 * d) // d, channel=np.zeros(2 * d, int))
    c = replace(c, tied=True)
    for w in (0.1, 0.4, 1.0, 1.2):
        gaussian = norm.logpdf(e, scale=w**-0.5) + (d - 1) * norm.logpdf(0.0, scale=w**-0.5)
        ours = gaussian + amplitudes._bound(c, np.full(2 * d, w)) / 2 if w != 1.0 else ln_bound(e, w, d)
        assert np.all(ours <= ln_t(e, d) + 1e-9)
        touched = np.sqrt(max((DEGREES + d) / w - DEGREES, 0.0))
        assert ln_bound(touched, w, d) == pytest.approx(ln_t(touched, d), abs=1e-9)
        assert ours == pytest.approx(ln_bound(e, w, d), abs=1e-9)


@pytest.mark.parametrize("tied", [False, True])
def test_the_bound_touches_heavy_tails_at_the_weights_of_the_noise(tied):
    rng = np.random.default_rng(3)
    c = replace(columns(rng), rows=np.arange(READINGS) // 3, tied=tied)
    fit, noise = SimpleNamespace(columns=c, noise=1.5), 4.0 * rng.standard_t(2, READINGS)
    w = amplitudes._heavy(fit, noise, np.zeros(READINGS))
    label, size, _ = c.tails
    lengths = np.sqrt(np.bincount(label, noise**2)) / 1.5
    expected = sum(map(ln_t, lengths, size)) - READINGS * np.log(1.5)
    gaussian = norm.logpdf(noise, scale=1.5 * w**-0.5).sum()
    assert gaussian + amplitudes._bound(c, w) == pytest.approx(expected, abs=1e-9)


def test_priors_are_those_of_the_table():
    rng = np.random.default_rng(0)
    c, some = columns(rng), parts(rng)
    at, w = np.array([0.3, 0.8, -1.0, 0.5]), np.ones(READINGS)
    fit = amplitudes._evaluate(c, some, at, w, np.eye(len(c)))[0]
    of_noise = cauchy.logpdf(0.3, scale=2 * NOISE_SD) - cauchy.logpdf(0.0, scale=2 * NOISE_SD)
    prior = of_noise - 0.5 * (0.8 / (2 * NUMBERS_SD)) ** 2
    assert fit.score - fit.likelihood == pytest.approx(prior, abs=1e-12)
    repeated = columns(np.random.default_rng(0), repeats=1.44)
    assert amplitudes.noise_prior(c, -0.3) == pytest.approx(-0.5 * (0.3 / (2 * NOISE_SD)) ** 2)
    centre, sd = amplitudes.declared_noise(repeated)
    assert (centre, sd) == pytest.approx((np.log(1.44), 2 / np.sqrt(20)))
    by_repeats = norm.logpdf(0.9, centre, sd) - norm.logpdf(centre, centre, sd)
    assert amplitudes.noise_prior(repeated, 0.9) == pytest.approx(by_repeats)


def test_the_price_of_an_effect_is_the_mean_over_its_sizes():
    """Against determinants of the whole covariance at each size."""
    rng = np.random.default_rng(3)
    c, some = columns(rng), parts(rng)
    at, w = np.array([0.1, -1.0, -0.5, 1.2]), np.ones(READINGS)
    fit = amplitudes.evaluated(c, some[2:], at[[0, 3]], w)
    bare = amplitudes._information(*amplitudes._evaluate(c, some[2:], at[[0, 3]], w, np.eye(len(c))))
    sizes = [np.array([at[0], 2 * np.log(b)]) for b in SIZES]
    each = [multivariate_normal(cov=dense(c, some[2:], x, w)).logpdf(c.residual) for x in sizes]
    price = np.logaddexp.reduce(each) - np.log(len(each)) - fit.likelihood
    scale = 2 * NOISE_SD
    bend = 2 / (scale**2 + at[0] ** 2)  # of ln Cauchy: its slope over the distance from its centre
    kappa = -0.5 * np.log1p(scale**2 * (bare[0, 0] - bend))
    prior = cauchy.logpdf(at[0], scale=scale) - cauchy.logpdf(0.0, scale=scale)
    assert fit.score == pytest.approx(fit.likelihood + prior + kappa + price, abs=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_amplitudes_of_drawn_readings_are_found_and_what_is_not_there_is_off(seed):
    rng = np.random.default_rng(seed)
    c, some = columns(rng), parts(rng)
    truth = np.array([0.0, -30.0, -30.0, 2 * np.log(6.0)])
    drawn = np.linalg.cholesky(dense(c, some, truth, np.ones(READINGS))) @ rng.normal(size=len(c))
    fit = amplitudes.fitted(columns(np.random.default_rng(seed), drawn), some)
    assert fit.amplitude("effect") == pytest.approx(6.0, rel=0.9)
    assert fit.amplitude("gap") < 0.7
    assert fit.noise == pytest.approx(1.0, abs=0.35)


def test_one_wild_reading_moves_nothing_under_heavy_tails():
    rng = np.random.default_rng(5)
    c, some = columns(rng), parts(rng)
    drawn = np.linalg.cholesky(
        dense(c, some, np.array([0.0, -30, -30, 1.0]), np.ones(READINGS))
    ) @ rng.normal(size=len(c))
    wild = np.zeros(READINGS)
    wild[7] = 25.0
    quiet = amplitudes.fitted(columns(np.random.default_rng(5), drawn), some)
    loud = amplitudes.fitted(columns(np.random.default_rng(5), drawn + c.free.T @ wild), some)
    assert np.all(quiet.weights == 1.0) and loud.weights[7] < 0.05
    change = np.linalg.norm(loud.mean(some[2]) - quiet.mean(some[2]))
    assert change < 0.5 * np.linalg.norm(quiet.mean(some[2])) + 0.5
    assert loud.noise < 1.4


def test_heavy_tails_that_fell_far_short_are_not_tried_with_one_effect_more(monkeypatch):
    rng = np.random.default_rng(5)
    c, some = columns(rng), parts(rng)
    wild = np.where(np.arange(READINGS) == 7, 25.0, 0.0)
    slipped = replace(c, residual=rng.normal(size=len(c)) + c.free.T @ wild)
    tried = amplitudes.fitted(slipped, some)
    spared = amplitudes.fitted(slipped, some, lighter=2.5 * amplitudes.CATCHES_UP)
    assert np.all(spared.weights == 1.0) and spared.lighter == 1.5 * amplitudes.CATCHES_UP
    assert tried.weights[7] < 0.05 and tried.score > spared.score
    near = amplitudes.fitted(slipped, some, lighter=0.5 * amplitudes.CATCHES_UP)
    assert np.array_equal(near.weights, tried.weights)
    plain = replace(c, residual=np.resize([1.0, -1.0], len(c)))
    monkeypatch.setattr(amplitudes, "STANDS_OUT", 0.5)  # tried without need, they fall short
    light = amplitudes.fitted(plain, some[:1])
    assert np.all(light.weights == 1.0) and light.lighter > 0.0
    assert amplitudes.refitted(light, plain.residual).lighter == light.lighter


def test_a_part_far_larger_than_the_noise_is_factorised_all_the_same():
    smooth = np.exp(-0.5 * (np.arange(40.0)[:, None] - np.arange(40.0)) ** 2 / 400.0)
    v = np.eye(40) + 1e17 * smooth
    root = amplitudes._root(v)
    assert np.abs(root @ root.T - v).max() < 1e-10 * v.max()


def test_shares_are_those_of_the_readings_that_do_not_stand_alone():
    """Squares of posterior means by their dense formulas; a reading of next to no weight counts in none of them."""
    rng = np.random.default_rng(5)
    c, some = columns(rng), parts(rng)
    w, at = np.ones(READINGS), np.array([0.2, 0.5, -0.5, 0.8])
    w[[3, 11]] = 1e-4
    found = shares(c, amplitudes.evaluated(c, some, at, w))
    solved = np.linalg.solve(dense(c, some, at, w), c.residual)
    kept = w == 1.0
    matrices = [p.full if p.full is not None else p.factor @ p.factor.T for p in some]
    means = [np.exp(x) * (c.free @ (m @ solved))[kept] for x, m in zip(at[1:], matrices, strict=True)]
    means.append(np.exp(at[0]) * (c.free @ solved)[kept])
    squares = np.array([np.sum(m**2) for m in means])
    assert list(found.values()) == pytest.approx(list(squares / squares.sum()), rel=1e-8)


def test_what_carries_over_in_time_is_bounded_and_all_else_is_best_next_to_it():
    rng = np.random.default_rng(2)
    c, (numbers, gap, effect) = columns(rng), parts(rng)
    some = (numbers, replace(gap, name="wander", kind="time", most=WIDEST), effect)
    truth = np.array([0.0, -30.0, 9.0, 5.0])
    drawn = np.linalg.cholesky(dense(c, some, truth, np.ones(READINGS))) @ rng.normal(size=len(c))
    c = columns(np.random.default_rng(2), drawn)
    fit = amplitudes._optimum(c, some, np.zeros(4), np.ones(READINGS))
    assert (
        fit.t[2]
        == WIDEST
        < amplitudes._optimum(c, (numbers, gap, effect), np.zeros(4), np.ones(READINGS)).t[2]
    )
    for k in (0, 3):
        for step in (-0.3, 0.3):
            other = fit.t + step * np.eye(4)[k]
            noise = c.free.T @ c.free
            assert (
                amplitudes._evaluate(c, some, other, fit.weights, noise)[0].score
                < amplitudes._evaluate(c, some, fit.t, fit.weights, noise)[0].score
            )
