"""Machines whose stiffness has a closed form."""

from __future__ import annotations

import numpy as np
import pytest
from tests.python.solve import builders as b

import stiffmap as sm
from stiffmap.model.description import Law, Pose

METHODS = ("fast", "reference")


@pytest.mark.parametrize("method", METHODS)
def test_cantilever(method: str) -> None:
    c = b.cantilever_compliance(0.8, 2e8, 3e4, 1.5e4)
    machine = b.serial(b.shift("link", (0.8, 0, 0)), b.soft("beam", c), home=Pose.of((0.8, 0, 0)))
    got = machine.solve((0.8, 0, 0), method=method)
    np.testing.assert_allclose(got.compliance, c, rtol=1e-12, atol=1e-22)
    blocked = got.stiffness  # tip rotation held: 12 EI / L^3
    assert blocked[1, 1] == pytest.approx(12 * 3e4 / 0.8**3, rel=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_springs_in_series_add_their_compliances(method: str) -> None:
    rng = np.random.default_rng(3)
    k1, k2 = b.random_spd(rng), b.random_spd(rng)
    machine = b.serial(b.stiff("one", k1), b.stiff("two", k2))
    got = machine.solve((0, 0, 0), method=method).compliance
    np.testing.assert_allclose(got, np.linalg.inv(k1) + np.linalg.inv(k2), rtol=1e-10, atol=1e-16)


@pytest.mark.parametrize("method", METHODS)
def test_springs_in_parallel_add_their_stiffnesses(method: str) -> None:
    rng = np.random.default_rng(4)
    k = [b.random_spd(rng) for _ in range(3)]
    machine = b.parallel(*((b.stiff("link", v),) for v in k))
    got = machine.solve((0, 0, 0), method=method).stiffness
    np.testing.assert_allclose(got, sum(k), rtol=1e-10, atol=1e-3)
    inside = b.serial(b.block("bars", *((b.stiff("link", v),) for v in k)))
    np.testing.assert_allclose(
        inside.solve((0, 0, 0), method=method).stiffness, sum(k), rtol=1e-10, atol=1e-3
    )


def lever(p: np.ndarray) -> np.ndarray:
    """Twist of a point at p from the twist at the origin."""
    a = np.eye(6)
    a[:3, 3:] = -np.array([[0, -p[2], p[1]], [p[2], 0, -p[0]], [-p[1], p[0], 0]])
    return a


@pytest.mark.parametrize("method", METHODS)
def test_rigid_offset_is_a_congruence(method: str) -> None:
    rng = np.random.default_rng(5)
    k, p = b.random_spd(rng), np.array([0.3, -0.2, 0.5])
    machine = b.serial(b.stiff("link", k), b.shift("tool", p), home=Pose.of(p))
    c = lever(p) @ np.linalg.inv(k) @ lever(p).T
    np.testing.assert_allclose(machine.solve(p, method=method).compliance, c, rtol=1e-10, atol=1e-16)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("elbow", [0.4, 1.3, 2.6])
def test_planar_2r(method: str, elbow: float) -> None:
    k1, k2, l1, l2, q1 = 4e4, 2.5e4, 0.5, 0.4, 0.3
    p = np.array([l1 * np.cos(q1) + l2 * np.cos(q1 + elbow), l1 * np.sin(q1) + l2 * np.sin(q1 + elbow), 0.0])
    machine = b.serial(
        b.motor("shoulder", home=q1, law=Law(k1)),
        b.shift("upper", (l1, 0, 0)),
        b.motor("elbow", home=elbow, law=Law(k2)),
        b.shift("fore", (l2, 0, 0)),
        home=Pose.of(p, b.rotation((0, 0, 1), q1 + elbow)),
    )
    got = machine.solve(p, rotation=b.rotation((0, 0, 1), q1 + elbow), method=method)
    elbow_at = np.array([l1 * np.cos(q1), l1 * np.sin(q1)])
    j = np.array([[-p[1], -(p[1] - elbow_at[1])], [p[0], p[0] - elbow_at[0]], [1, 1]])
    c = j @ np.diag([1 / k1, 1 / k2]) @ j.T
    plane = np.ix_([0, 1, 5], [0, 1, 5])
    np.testing.assert_allclose(got.compliance[plane], c, rtol=1e-10)
    rest = np.delete(np.delete(got.compliance, [0, 1, 5], 0), [0, 1, 5], 1)
    np.testing.assert_allclose(rest, 0, atol=1e-20)
    assert int(got.flags) & sm.Flag.RIGID_DIRECTION


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("q", [0.0, 0.3, -0.7])
def test_parallelogram(method: str, q: float) -> None:
    length, d = 0.775, 0.25
    k = np.linalg.inv(b.cantilever_compliance(length, 2e8, 3e4, 1.5e4))
    machine = b.parallelogram(k, d, length, q)
    got = machine.solve(machine.description.home.p, method=method)
    turn = np.kron(np.eye(2), b.rotation((0, 1, 0), q))  # bar frame: along the bars
    in_bars = turn.T @ got.stiffness @ turn
    c, s = np.cos(q), np.sin(q)
    wanted = np.zeros((6, 6))
    wanted[0, 0] = k[0, 0]
    wanted[1, 1] = k[1, 1]
    wanted[1, 5] = wanted[5, 1] = k[1, 5]
    wanted[3, 3] = k[3, 3] + d**2 * c**2 * k[1, 1] / 4
    wanted[4, 4] = d**2 * c**2 * k[0, 0] / 4
    wanted[5, 5] = k[5, 5] + d**2 * s**2 * k[1, 1] / 4
    # pins at +-(d/2)(-s, 0, c) in bar axes: a force along y has the moment +-(d/2)(-c, 0, -s)
    wanted[3, 5] = wanted[5, 3] = d**2 * np.sin(2 * q) * k[1, 1] / 8
    np.testing.assert_allclose(in_bars, 2 * wanted, rtol=1e-9, atol=1e-9 * k[0, 0])
    assert np.linalg.matrix_rank(in_bars, tol=1e-6 * k[5, 5]) == 5
    assert int(got.status) == sm.Status.SINGULAR and int(got.flags) & sm.Flag.PLATFORM_SINGULAR
    free = got.free_twists[:, 0]
    np.testing.assert_allclose(np.abs(turn.T @ free), [0, 0, 1, 0, 0, 0], atol=1e-9)
    assert np.isnan(got.compliance).all()
