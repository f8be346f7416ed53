"""The paper's misprints, each with a number (docs/theory.md)."""

from __future__ import annotations

import numpy as np
import pytest
from tests.python.solve import builders as b


def field(points: np.ndarray, t: np.ndarray, phi: np.ndarray) -> np.ndarray:
    """Displacements of points of a rigid body, turned exactly."""
    r = b.rotation(phi, float(np.linalg.norm(phi)))
    return t + points @ (r - np.eye(3)).T


def estimate(points: np.ndarray, u: np.ndarray, first: float, sign: float) -> tuple[np.ndarray, np.ndarray]:
    """Eq. (16) about the centroid: normal equations with `first` times I and sign * (p x phi)."""
    p = points - points.mean(axis=0)
    skews = np.array([[[0, -z, y], [z, 0, -x], [-y, x, 0]] for x, y, z in p])
    turn = sum(s.T @ s for s in skews)
    t = u.sum(axis=0) / first
    phi = np.linalg.solve(turn, sign * np.einsum("nij,ni->j", skews, u))
    return t, phi


@pytest.fixture
def cloud() -> np.ndarray:
    return np.random.default_rng(1).uniform(-0.05, 0.05, (40, 3)) + [0.2, -0.1, 0.3]


PHI = np.array([2e-5, -3e-5, 1e-5])
SHIFT = np.array([1e-4, 2e-4, -3e-4])


def test_14_printed_p_cross_phi_turns_the_sign(cloud: np.ndarray) -> None:
    u = field(cloud, SHIFT, PHI)
    # u = t + phi x p = t - S(p) phi: the printed + S(p) phi has the opposite rotation
    np.testing.assert_allclose(estimate(cloud, u, len(cloud), -1.0)[1], PHI, rtol=1e-4)
    np.testing.assert_allclose(estimate(cloud, u, len(cloud), +1.0)[1], -PHI, rtol=1e-4)


def test_16_first_block_is_n_and_t_belongs_to_the_centroid(cloud: np.ndarray) -> None:
    u, n = field(cloud, SHIFT, PHI), len(cloud)
    centre = cloud.mean(axis=0)
    t, phi = estimate(cloud, u, n, -1.0)
    np.testing.assert_allclose(t, SHIFT + np.cross(PHI, centre), rtol=1e-4)
    np.testing.assert_allclose(t - np.cross(phi, centre), SHIFT, rtol=1e-3)
    printed, _ = estimate(cloud, u, 1 / n, -1.0)
    np.testing.assert_allclose(printed / t, n**2, rtol=1e-9)  # n^-1 I is wrong by n squared


def test_8_compliance_is_deflections_times_inverse_wrenches() -> None:
    rng = np.random.default_rng(2)
    k = np.linalg.inv(b.random_spd(rng))
    wrenches = rng.normal(size=(6, 9))
    deflections = k @ wrenches
    np.testing.assert_allclose(deflections @ np.linalg.pinv(wrenches), k, rtol=1e-9, atol=1e-18)
    transposed = wrenches @ np.linalg.pinv(deflections)  # has the size of a stiffness
    assert np.linalg.norm(transposed) > 1e6 * np.linalg.norm(k)


def test_19_the_covariance_of_t_gains_the_rotation_away_from_the_centroid(cloud: np.ndarray) -> None:
    rng = np.random.default_rng(3)
    far, sigma, n = np.array([0.3, 0.2, 0.1]), 1e-6, len(cloud)
    fits = [estimate(cloud, sigma * rng.normal(size=(n, 3)), n, -1.0) for _ in range(4000)]
    t, phi = (np.array(v) for v in zip(*fits, strict=True))
    at_far = t + np.cross(phi, far)
    p = cloud - cloud.mean(axis=0)
    turn = np.linalg.inv((p**2).sum() * np.eye(3) - p.T @ p)
    s = np.array([[0, -far[2], far[1]], [far[2], 0, -far[0]], [-far[1], far[0], 0]])
    np.testing.assert_allclose(np.cov(t.T).diagonal(), sigma**2 / n, rtol=0.1)
    wanted = sigma**2 * (np.eye(3) / n + s @ turn @ s.T)
    np.testing.assert_allclose(np.cov(at_far.T).diagonal(), wanted.diagonal(), rtol=0.1)
    assert (wanted.diagonal() > 5 * sigma**2 / n).all()


def test_section_5_3_seven_times_forces_1_40() -> None:
    """aI + b·ones: a ratio of 7 of its eigenvalues makes the largest 1.40 times the answer to Fx."""
    a = 1.0
    c = a * np.eye(2) + (7 - 1) / 2 * a * np.ones((2, 2))
    low, high = np.linalg.eigvalsh(c)
    assert high / low == pytest.approx(7)
    assert high / np.linalg.norm(c @ [1, 0]) == pytest.approx(1.40, abs=5e-3)


def test_5_2_table_1_holds_compliances() -> None:
    """sqrt(3 k22 / k66) is a length of 781 mm for compliances of a beam, and none for stiffnesses."""
    c = b.cantilever_compliance(0.775, 2e8, 3e4, 2e4)
    assert np.sqrt(3 * c[1, 1] / c[5, 5]) == pytest.approx(0.775)
    k = np.linalg.inv(c)
    assert np.sqrt(3 * k[1, 1] / k[5, 5]) == pytest.approx(3 / 0.775)  # an inverse length
