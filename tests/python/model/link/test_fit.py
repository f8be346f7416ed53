"""The paper's equations (13)-(19), each against an independent computation; the printed forms must fail."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from tests.python.model.link.link_fields import REFERENCE, bar_compliance, end_nodes

from stiffmap.model.link.rigidfit import design_matrix, fit_exact, fit_factor, fit_linear, parting_rotation
from stiffmap.model.link.transport import skew

POINTS = end_nodes(40)
TWIST = np.array([2e-6, -5e-6, 1e-6, 3e-5, -2e-5, 4e-5])


def moved(points, phi, t, reference):
    return (points - reference) @ Rotation.from_rotvec(phi).as_matrix().T + reference + t - points


def test_skew_is_the_cross_product():
    a, b = np.random.default_rng(0).standard_normal((2, 3))
    assert skew(a) @ b == pytest.approx(np.cross(a, b))


def test_14_rotation_displaces_by_phi_cross_p():
    """Small true rotation: phi x p is right to second order, the printed p x phi has the wrong sign."""
    phi, p = np.array([1e-6, -2e-6, 3e-6]), POINTS[0] - REFERENCE
    true = moved(p[None], phi, np.zeros(3), np.zeros(3))[0]
    assert np.cross(phi, p) == pytest.approx(true, abs=1e-12)
    assert np.cross(p, phi) == pytest.approx(-true, abs=1e-12)


def test_16_agrees_with_lstsq_and_the_printed_one_over_n_does_not():
    u = np.random.default_rng(2).standard_normal(POINTS.shape) * 1e-6
    A = design_matrix(POINTS, REFERENCE)
    expected = np.linalg.lstsq(A.reshape(-1, 6), u.ravel(), rcond=None)[0]
    fit = fit_linear(POINTS, u, REFERENCE)
    assert fit.twist == pytest.approx(expected, rel=1e-9)
    printed_t = np.linalg.solve(np.eye(3) / len(u), u.sum(axis=0))  # n^-1 I inverted: n^2 times the mean
    assert printed_t == pytest.approx(len(u) ** 2 * u.mean(axis=0))


def test_16_gives_the_centroid_and_transport_the_reference():
    u = TWIST[:3] + np.cross(TWIST[3:], POINTS - REFERENCE)
    assert fit_linear(POINTS, u, REFERENCE).twist == pytest.approx(TWIST, rel=1e-9)
    assert np.abs(u.mean(axis=0) - TWIST[:3]).max() > 1e-7  # the mean alone is another point's displacement


def test_19_holds_at_the_centroid_and_gains_terms_at_the_reference():
    A = design_matrix(POINTS, REFERENCE).reshape(-1, 6)
    assert fit_factor(POINTS, REFERENCE) == pytest.approx(np.linalg.inv(A.T @ A), rel=1e-8)
    S = skew(POINTS - POINTS.mean(axis=0))
    at_centroid = fit_factor(POINTS, POINTS.mean(axis=0))
    assert at_centroid[:3, :3] == pytest.approx(np.eye(3) / len(POINTS), abs=1e-12)
    assert at_centroid[3:, 3:] == pytest.approx(np.linalg.inv(np.einsum("nki,nkj->ij", S, S)))
    assert fit_factor(POINTS, REFERENCE)[1, 1] > 1.3 / len(POINTS)


def test_13_exact_fit_is_the_minimum_over_rotations():
    rng = np.random.default_rng(4)
    u = moved(POINTS, np.array([0.2, -0.5, 0.3]), np.array([0.01, 0.02, -0.01]), REFERENCE)
    u += 1e-4 * rng.standard_normal(u.shape)
    fit = fit_exact(POINTS, u, REFERENCE)
    best = least_squares(
        lambda x: (u - moved(POINTS, x[3:], x[:3], REFERENCE)).ravel(),
        fit.twist + 1e-3,
        xtol=1e-15,
        ftol=1e-15,
    )
    assert fit.twist == pytest.approx(best.x, abs=1e-8)
    assert fit.rss == pytest.approx(2 * best.cost, rel=1e-9)


@pytest.mark.parametrize("angle", [1e-9, 1e-3, 3.0])
def test_exact_fit_recovers_any_rotation(angle):
    phi = angle * np.array([2.0, -1.0, 2.0]) / 3
    fit = fit_exact(POINTS, moved(POINTS, phi, TWIST[:3], REFERENCE), REFERENCE)
    assert fit.twist[3:] == pytest.approx(phi, abs=1e-13)
    assert fit.twist[:3] == pytest.approx(TWIST[:3], abs=1e-15)


def test_linear_error_is_second_order():
    """Halving the rotation quarters the error of the linearised estimate."""
    axis = np.array([1.0, 2.0, -1.0])
    error = []
    for angle in (0.04, 0.02, 0.01):
        phi = angle * axis
        fit = fit_linear(POINTS, moved(POINTS, phi, np.zeros(3), REFERENCE), REFERENCE)
        error.append(np.abs(fit.twist - np.concatenate([np.zeros(3), phi])).max())
    assert np.log2(error[0] / error[1]) == pytest.approx(2, abs=0.1)
    assert np.log2(error[1] / error[2]) == pytest.approx(2, abs=0.1)


def test_parting_rotation_is_where_one_standard_error_is_reached():
    axis, sigma = np.array([0.3, 1.0, 0.2]), 1e-7
    angle = parting_rotation(POINTS, REFERENCE, sigma, axis)
    phi = angle * axis / np.linalg.norm(axis)
    u = moved(POINTS, phi, np.zeros(3), POINTS.mean(axis=0))
    gap = fit_linear(POINTS, u, REFERENCE).twist - fit_exact(POINTS, u, REFERENCE).twist
    error = sigma * np.sqrt(np.diag(fit_factor(POINTS, REFERENCE)))
    assert np.max(np.abs(gap) / error) == pytest.approx(1.0, rel=1e-5)
    assert parting_rotation(POINTS, REFERENCE, 100 * sigma, axis) == pytest.approx(10 * angle, rel=0.05)


def test_08_is_transposed_in_print():
    """k = [t; phi] [F; M]^+; the printed product is wrong unless the wrenches are multiples of I."""
    rng = np.random.default_rng(6)
    C, W = bar_compliance(), rng.standard_normal((6, 8))
    X = C @ W
    assert X @ np.linalg.pinv(W) == pytest.approx(C, rel=1e-8, abs=1e-12)
    six = W[:, :6]
    assert np.abs(np.linalg.inv(six) @ (C @ six) - C).max() > 0.1 * np.abs(C).max()


def test_20_has_3n_minus_6_degrees_of_freedom():
    rng, n = np.random.default_rng(8), 5
    points = POINTS[:n]
    rss = [fit_linear(points, rng.standard_normal((n, 3)), REFERENCE).rss for _ in range(4000)]
    assert np.mean(rss) == pytest.approx(3 * n - 6, abs=4 * np.sqrt(2 * (3 * n - 6) / 4000))
