"""Monte-Carlo proof of the statistics for independent noise (fixed seeds)."""

from __future__ import annotations

from unittest.mock import patch

import numpy as np
import pytest
from bench.link_monte_carlo import miss_probability
from scipy.stats import binom, kstest
from tests.python.model.link.link_fields import REFERENCE, WRENCHES, bar_compliance, end_nodes, rigid_field

from stiffmap.model.link.identify import identify_link
from stiffmap.model.link.noise import analyse_correlation
from stiffmap.model.link.rigidfit import fit_linear

RUNS, SIGMA = 1000, 2e-8
LINEAR = patch("stiffmap.model.link.identify.finite_rotation", return_value="")
"""Whether a field turns too far is three quarters of the time: the default path asks, and test_identify.py."""


@pytest.fixture(scope="module")
def runs():
    """Identifications of one bar under new noise: symmetric, without the paths tested elsewhere."""
    rng = np.random.default_rng(11)
    points = end_nodes(24)
    clean = rigid_field(bar_compliance(), WRENCHES, points, REFERENCE)
    with LINEAR:
        return [
            identify_link(
                points, clean + SIGMA * rng.standard_normal(clean.shape), WRENCHES,
                reference=REFERENCE, noise="independent", outliers=False,
            )
            for _ in range(RUNS)
        ]  # fmt: skip


def test_z_scores_are_standard_normal(runs):
    z = np.array([(r.compliance - bar_compliance()) / r.standard_error for r in runs])
    for i in range(6):
        for j in range(i, 6):
            assert kstest(z[:, i, j], "norm").pvalue > 1e-3 / 21, (i, j)
            assert abs(z[:, i, j].var() - 1) < 4.5 * np.sqrt(2 / RUNS), (i, j)


def test_raw_z_scores_are_standard_normal_too(runs):
    z = [(r.raw - bar_compliance()) / np.sqrt(np.diag(r.raw_covariance)).reshape(6, 6) for r in runs]
    assert np.all(np.abs(np.var(z, axis=0) - 1) < 4.5 * np.sqrt(2 / RUNS))


def test_whole_covariance_is_right(runs):
    """Mahalanobis distance of the 21 entries has chi-square(21)'s mean and variance: all of V is right."""
    upper = [6 * i + j for i in range(6) for j in range(i, 6)]
    d2 = []
    for r in runs:
        e = (r.compliance - bar_compliance()).ravel()[upper]
        V = r.covariance[np.ix_(upper, upper)]
        s = np.sqrt(np.diag(V))
        d2.append((e / s) @ np.linalg.solve(V / np.outer(s, s), e / s))
    assert np.mean(d2) == pytest.approx(
        21, abs=4 * np.sqrt(42 / RUNS) + 21 * 2 / 394
    )  # F(21, 396): mean 21*396/394
    assert np.var(d2) == pytest.approx(42, rel=0.25)


def test_95_percent_intervals_cover_95_percent(runs):
    true = bar_compliance()
    inside = np.array([(r.interval()[..., 0] <= true) & (true <= r.interval()[..., 1]) for r in runs])
    low, high = binom.ppf([1e-4, 1 - 1e-4], RUNS, 0.95)
    hits = inside.sum(axis=0)
    assert np.all((hits >= low) & (hits <= high)), hits


def test_family_of_true_zeros_keeps_its_level(runs):
    """A true zero taken for non-zero, anywhere in a matrix: at most 5 % of matrices (13 of 21 are zero)."""
    zero = bar_compliance() == 0
    wrong = sum(bool(np.any(~r.insignificant & zero)) for r in runs)
    assert wrong <= binom.ppf(1 - 1e-4, RUNS, 0.05)
    assert wrong >= binom.ppf(
        1e-4, RUNS, 0.05 * 13 / 21 * 0.8
    )  # and it is no empty promise: near 13/21 of it


def test_false_zeros_come_as_often_as_predicted():
    """Entries 2 to 5 standard errors large, declared zero: as often as the noncentral t says."""
    rng = np.random.default_rng(5)
    points = rng.uniform(-1, 1, (12, 3)) * 0.02
    W, n_runs = np.diag([100.0, 10, 10, 1, 1, 1]), 600
    base = np.diag([1e-7, 3e-6, 2e-6, 1e-4, 2e-4, 3e-4])
    quiet = identify_link(
        points, rigid_field(base, W, points, np.zeros(3)), W, reference=np.zeros(3), noise=1e-7
    )
    sizes = {(0, 1): 2.0, (1, 5): 3.0, (2, 4): 4.0, (0, 3): 5.0}
    true = base.copy()
    for (i, j), size in sizes.items():
        true[i, j] = true[j, i] = size * quiet.standard_error[i, j]
    clean = rigid_field(true, W, points, np.zeros(3))
    called = np.zeros((6, 6))
    with LINEAR:
        for _ in range(n_runs):
            u = clean + 1e-7 * rng.standard_normal(clean.shape)
            called += identify_link(
                points, u, W, reference=np.zeros(3), noise="independent", outliers=False
            ).insignificant
    for (i, j), size in sizes.items():
        p = float(miss_probability(size, 1.0, 6 * (3 * 12 - 6), 0.05, 21))
        assert binom.ppf(1e-4, n_runs, p) <= called[i, j] <= binom.ppf(1 - 1e-4, n_runs, p), (i, j, p)


def test_default_path_keeps_the_errors_right():
    """All tests switched on (outliers, independence, pooling): z-scores still have unit variance."""
    rng = np.random.default_rng(3)
    points = end_nodes(60)
    clean = rigid_field(bar_compliance(), WRENCHES, points, REFERENCE)
    z, removed = [], 0
    for _ in range(120):
        link = identify_link(
            points, clean + SIGMA * rng.standard_normal(clean.shape), WRENCHES, reference=REFERENCE
        )
        z.append(((link.compliance - bar_compliance()) / link.standard_error)[np.triu_indices(6)])
        removed += int(link.outliers.sum())
    # 21 correlated entries: at least six independent ones, so 720 effective draws of the variance.
    assert np.var(z) == pytest.approx(1.0, abs=4 * np.sqrt(2 / 720))
    assert removed <= binom.ppf(1 - 1e-4, 120, 0.01) + 1


def test_homogeneity_p_values_are_uniform(runs):
    assert kstest([r.evidence.noise.homogeneity for r in runs], "uniform").pvalue > 1e-3


def test_symmetry_p_values_are_uniform(runs):
    assert kstest([r.symmetry_p_value for r in runs], "uniform").pvalue > 1e-3


def test_independence_is_rejected_at_its_level():
    """Moran's z of clean residuals is standard normal: exact moments for least-squares residuals."""
    rng = np.random.default_rng(8)
    points = end_nodes(60)
    p = [analyse_correlation(points, residuals(points, rng)).p_value for _ in range(400)]
    assert kstest(p, "uniform").pvalue > 1e-3


def residuals(points, rng):
    return np.array(
        [fit_linear(points, rng.standard_normal(points.shape), REFERENCE).residual for _ in range(6)]
    )
