"""identify_link: noise-free recovery, cases, reference point, zeros, symmetry, outliers, correlated noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation
from tests.python.model.link.link_fields import (
    REFERENCE,
    WRENCHES,
    L,
    bar_compliance,
    end_nodes,
    noisy_field,
    rigid_field,
)

from stiffmap.common.errors import StiffmapError
from stiffmap.model.link.identify import identify_link
from stiffmap.model.link.report import bending_lengths
from stiffmap.model.link.transport import twist_transport

C = bar_compliance()
SIZE = np.sqrt(np.outer(np.diag(C), np.diag(C)))


def identify(points, u, wrenches=WRENCHES, **options):
    return identify_link(points, u, wrenches, reference=REFERENCE, **options)


def test_exact_field_gives_the_exact_matrix():
    points = end_nodes(30)
    link = identify(points, rigid_field(C, WRENCHES, points, REFERENCE))
    assert np.abs((link.compliance - C) / SIZE).max() < 1e-11
    assert np.abs(link.stiffness @ C - np.eye(6)).max() < 1e-7
    assert not link.outliers.any()


def test_result_has_the_contract_shapes():
    link = identify(*noisy_field())
    shapes = {"compliance": (6, 6), "stiffness": (6, 6), "covariance": (36, 36), "standard_error": (6, 6)}
    shapes |= {"insignificant": (6, 6), "outliers": (6, 80), "sigma": (6,), "dof": (6,)}
    assert {name: np.shape(getattr(link, name)) for name in shapes} == shapes
    assert np.all(link.dof == 3 * (80 - link.outliers.sum(axis=1)) - 6)
    assert link.sigma == pytest.approx(2e-8, rel=0.25)


def test_more_cases_and_mixed_magnitudes():
    rng = np.random.default_rng(2)
    W = rng.standard_normal((14, 6)) * [1000, 10, 10, 1, 1, 1] * np.geomspace(0.3, 3, 14)[:, None]
    link = identify(*noisy_field(wrenches=W), W)
    assert np.abs((link.compliance - C) / link.standard_error).max() < 4.5
    assert 0.001 < link.case_p_value < 0.999
    bad = noisy_field(wrenches=W)[1]
    bad[3] *= 1.01
    assert identify(end_nodes(80), bad, W).case_p_value < 1e-6


def test_unequal_noise_is_weighted_and_not_pooled():
    """Twelve cases, six of them ten times noisier: the weighted estimate hardly uses those."""
    W = np.vstack([WRENCHES, WRENCHES])
    points, u = noisy_field(wrenches=W)
    rng = np.random.default_rng(9)
    u[6:] += 2e-7 * rng.standard_normal(u[6:].shape)
    link, good = identify(points, u, W, noise="independent"), identify(points, u[:6], noise="independent")
    assert not link.evidence.noise.pooled
    assert good.evidence.noise.pooled
    assert np.abs(link.standard_error / good.standard_error - 1).max() < 0.15
    assert np.abs((link.compliance - C) / link.standard_error).max() < 4.5


def test_repeating_a_case_with_new_noise_halves_the_variance():
    W = np.vstack([WRENCHES] * 4)
    once, four = identify(*noisy_field(), noise=2e-8), identify(*noisy_field(wrenches=W), W, noise=2e-8)
    assert once.standard_error / four.standard_error == pytest.approx(np.full((6, 6), 2.0), rel=0.02)


def test_partial_wrenches_use_symmetry_and_leave_the_rest_nan():
    W = WRENCHES[:3]
    link = identify(*noisy_field(wrenches=W), W, partial=True)
    assert np.isnan(link.compliance[3:, 3:]).all()
    assert np.isfinite(link.compliance[:3]).all()
    assert np.isfinite(link.compliance[:, :3]).all()
    assert np.abs((link.compliance - C) / link.standard_error)[:3].max() < 4.5
    assert np.isnan(link.stiffness).all()
    assert "not identified: k44" in link.report()


def test_zero_test_finds_the_bars_pattern_and_reestimates():
    link = identify(*noisy_field(sigma=2e-9))
    assert np.array_equal(link.insignificant, C == 0)
    clean = link.with_zeros()
    assert np.all(clean.compliance[C == 0] == 0)
    assert np.all(clean.standard_error[C == 0] == 0)
    assert np.all(clean.standard_error <= link.standard_error * (1 + 1e-9))
    assert np.abs((clean.compliance - C)[C != 0] / clean.standard_error[C != 0]).max() < 4.5
    applied = identify(*noisy_field(sigma=2e-9), zeros="apply")
    assert np.array_equal(applied.compliance, clean.compliance)


def test_symmetry_is_estimated_not_averaged():
    """k26 is measured by a force and by a moment with different errors: the better one counts."""
    link = identify(*noisy_field(sigma=1e-7))
    assert (
        np.array_equal(link.compliance, link.compliance.T)
        or np.abs(link.compliance / link.compliance.T - 1).max() < 1e-9
    )
    raw_error = np.sqrt(np.diag(link.raw_covariance)).reshape(6, 6)
    assert link.standard_error[1, 5] <= min(raw_error[1, 5], raw_error[5, 1])
    assert link.symmetry_p_value > 1e-3
    assert identify(*noisy_field(sigma=1e-7), symmetric=False).compliance == pytest.approx(link.raw)


def test_transport_agrees_with_identification_at_the_other_point():
    """Same field, wrenches restated at the other point: same matrix and covariance."""
    points, u = noisy_field()
    other = REFERENCE + np.array([-0.07, 0.02, 0.01])
    T = twist_transport(other - REFERENCE)
    there = identify_link(points, u, WRENCHES @ np.linalg.inv(T), reference=other)
    C2, V2 = identify(points, u).at(other)
    size = np.sqrt(np.outer(np.diag(C2), np.diag(C2)))
    assert np.abs((there.compliance - C2) / size).max() < 1e-9
    error = np.sqrt(np.diag(V2))
    assert np.abs((there.covariance - V2) / np.outer(error, error)).max() < 1e-6


def test_stiffness_error_agrees_with_sampling():
    link = identify(*noisy_field(sigma=1e-8))
    rng = np.random.default_rng(0)
    samples = rng.multivariate_normal(link.compliance.ravel(), link.covariance, 4000, method="eigh")
    spread = np.linalg.inv(samples.reshape(-1, 6, 6)).std(axis=0)
    error = np.sqrt(np.diag(link.stiffness_covariance)).reshape(6, 6)
    assert spread == pytest.approx(error, rel=0.06)


def test_single_and_regional_outliers_are_removed_and_nothing_else():
    points, u = noisy_field()
    bad = np.zeros((6, 80), dtype=bool)
    bad[:, np.argsort(points[:, 2])[:24]] = True  # a region: 30 % of the nodes belong to another body
    bad[2, np.argmax(points[:, 1])] = True  # and one node at the load's singular point
    u[bad] += [3e-6, -2e-6, 1e-6]
    link = identify(points, u)
    assert np.all(link.outliers[bad])
    assert (link.outliers & ~bad).sum() <= 1
    assert np.abs((link.compliance - C) / link.standard_error).max() < 4.5
    assert np.abs((identify(points, u, outliers=False).compliance - C) / link.standard_error).max() > 20


def test_order_of_nodes_does_not_matter():
    points, u = noisy_field()
    u[:, :15] += 1e-6
    order = np.random.default_rng(0).permutation(80)
    a, b = identify(points, u), identify(points[order], u[:, order])
    assert np.array_equal(a.outliers[:, order], b.outliers)
    assert np.abs((a.compliance - b.compliance) / SIZE).max() < 1e-12


def correlated_field(rng, points, length, sigma=2e-8):
    R = np.linalg.cholesky(np.exp(-cdist(points, points) / length) + 1e-10 * np.eye(len(points)))
    clean = rigid_field(C, WRENCHES, points, REFERENCE)
    return clean + sigma * np.einsum("nm,kmi->kni", R, rng.standard_normal(clean.shape))


def test_correlated_noise_is_detected_and_the_errors_are_enlarged_rightly():
    """Naive errors are several times too small; the corrected z-scores have variance one within 25 %."""
    rng, points = np.random.default_rng(12), end_nodes(120)
    z, naive = [], []
    for _ in range(60):
        u = correlated_field(rng, points, 0.01)
        link, plain = (
            identify(points, u, outliers=False),
            identify(points, u, outliers=False, noise="independent"),
        )
        assert link.evidence.correlation.correlated
        z.append(((link.compliance - C) / link.standard_error)[np.triu_indices(6)])
        naive.append(((plain.compliance - C) / plain.standard_error)[np.triu_indices(6)])
    assert np.var(naive) > 5
    assert np.var(z) == pytest.approx(1.0, abs=0.25)
    assert 2 < link.evidence.correlation.effective_nodes < 40


def test_bootstrap_agrees_with_independent_noise_and_grows_with_correlation():
    points, u = noisy_field(n=400)
    link = identify(points, u)
    ratio = np.sqrt(np.diag(link.bootstrap(patches=64))).reshape(6, 6) / link.standard_error
    assert np.median(ratio) == pytest.approx(1.0, abs=0.2)
    u = correlated_field(np.random.default_rng(1), points, 0.004)
    plain = identify(points, u, noise="independent", outliers=False)
    grown = np.sqrt(np.diag(plain.bootstrap(patches=32))).reshape(6, 6) / plain.standard_error
    assert np.median(grown) > 1.7


def test_known_noise_is_used_with_infinite_degrees_of_freedom():
    link = identify(*noisy_field(), noise=5e-8)
    assert np.all(np.isinf(link.entry_dof))
    assert link.multiple[0, 0] == pytest.approx(3.038, abs=1e-3)  # 5 % over 21 tests, two-sided normal
    per_case = identify(*noisy_field(), noise=[5e-8] * 6)
    assert per_case.standard_error == pytest.approx(link.standard_error)


def turning_field(seed=0, noise=1e-8):
    """A field of finite rotations with independent noise."""
    points, W = end_nodes(60), WRENCHES * 2.0
    u = []
    for twist in W @ C.T:
        R = Rotation.from_rotvec(twist[3:]).as_matrix()
        u.append((points - REFERENCE) @ (R - np.eye(3)).T + twist[:3])
    return points, np.array(u) + noise * np.random.default_rng(seed).standard_normal((6, 60, 3)), W


def test_finite_rotation_is_taken_as_it_is():
    link = identify(*turning_field())
    assert link.evidence.method == "exact"
    assert np.abs((link.compliance - C) / link.standard_error).max() < 4.5
    assert link.outliers.sum() <= 2
    same = identify(*turning_field(), method="exact")
    assert np.array_equal(same.compliance, link.compliance)
    assert identify(*noisy_field()).evidence.method == "linear"


def test_noise_of_an_exact_fit_is_that_of_the_field():
    """Residuals of the exact fit, not of a linear one, say whether the noise is independent: estimated and given noise
    agree within what 1062 degrees of freedom leave open."""
    estimated, given = identify(*turning_field(seed=3)), identify(*turning_field(seed=3), noise=1e-8)
    ratio = estimated.standard_error / given.standard_error
    assert np.all((ratio > 0.93) & (ratio < 1.07))


def test_linear_field_of_any_size_is_accepted():
    """A linear solver's field has no finite rotation, whatever the load: nothing to refuse."""
    W = WRENCHES * 100.0
    link = identify(*noisy_field(wrenches=W), W)
    assert np.abs((link.compliance - C) / link.standard_error).max() < 4.5


def test_report_says_what_it_must():
    text = identify(*noisy_field()).report()
    for words in ("mm/N", "zero within 3.0", "asymmetry before symmetrisation", "positive definite",
                  "rigid-body residual", "pooled", "sqrt(3 k22/k66) = 310."):  # fmt: skip
        assert words in text, words


def test_indefinite_matrix_is_reported_not_repaired():
    points, bad = end_nodes(40), C.copy()
    bad[1, 5] = bad[5, 1] = 1.3 * np.sqrt(C[1, 1] * C[5, 5])
    u = rigid_field(bad, WRENCHES, points, REFERENCE) + 1e-9 * np.random.default_rng(0).standard_normal(
        (6, 40, 3)
    )
    link = identify(points, u)
    assert "NOT positive definite" in link.report()
    assert link.compliance[1, 5] == pytest.approx(bad[1, 5], rel=1e-3)


@pytest.mark.parametrize(("axis", "sense"), [(a, s) for a in range(3) for s in (1.0, -1.0)])
def test_lengths_of_a_cantilever_along_any_axis(axis, sense):
    """The bar's compliance turned to another axis keeps its four lengths and says the axis."""
    turn = np.roll(np.eye(3), axis, axis=0)
    if sense < 0:  # half a turn about the axis after x
        turn = turn @ np.diag([-1.0, 1.0, -1.0])
    assert turn[axis, 0] == sense
    Q = np.kron(np.eye(2), turn)
    found, lengths = bending_lengths(Q @ bar_compliance() @ Q.T)
    assert found == ("" if sense > 0 else "-") + "xyz"[axis]
    assert list(lengths.values()) == pytest.approx([L] * 4)


def test_wrenches_that_no_elastic_body_answers_are_said():
    points, u = noisy_field()
    words = "NOT an elastic body: compare order, units and reference of the wrenches"
    assert words not in identify(points, u).report()
    for wrong in (WRENCHES @ np.diag([1, 1, 1, 1e3, 1e3, 1e3]), WRENCHES[[1, 0, 2, 3, 4, 5]]):
        assert words in identify(points, u, wrong).report()


@pytest.mark.parametrize("point", [0.3, [0.3, 0.0], [0.3, 0.0, np.nan], "tip"])
def test_another_reference_is_a_point(point):
    with pytest.raises(StiffmapError, match=r"reference: expected .*\(3,\) in m|reference: expected finite"):
        identify(*noisy_field(n=10)).at(point)


def test_nodes_of_the_whole_part_are_no_rigid_end():
    """The part is stretched and twisted in proportion to the distance from the fixed end."""
    points = np.random.default_rng(3).uniform(size=(40, 3)) * [L, 0.02, 0.04] - [0, 0.01, 0.02]
    bent = rigid_field(C, WRENCHES, points, REFERENCE) * (points[:, :1] / L)
    assert "NOT rigid: are these nodes of the loaded end alone?" in identify(points, bent).report()
    assert "NOT rigid" not in identify(*noisy_field()).report()
