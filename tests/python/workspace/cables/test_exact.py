"""Cables against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from tests.python.workspace.cables.made import hanging

from stiffmap import Flag, Status, forward_kinematics, inverse_kinematics

EA, T = 2.0e5, 300.0
METHODS = ("fast", "reference")


@pytest.mark.parametrize("method", METHODS)
def test_pair(method: str) -> None:
    """k = EA (1/l1 + 1/l2) along the pair, T (1/L1 + 1/L2) across it."""
    m = hanging([(-1.2, 0, 0), (0.8, 0, 0)], elasticity=EA, pretension=T)
    s = m.solve((0, 0, 0), method=method)
    free = np.array([1.2, 0.8]) / (1 + T / EA)
    assert s.status == Status.CONVERGED
    assert np.abs(s.displacement).max() < 1e-15
    c = np.diag(s.compliance)[:3]
    np.testing.assert_allclose(1 / c[0], EA * (1 / free).sum(), rtol=1e-12)
    np.testing.assert_allclose(1 / c[1:], T * (1 / 1.2 + 1 / 0.8), rtol=1e-12)
    np.testing.assert_allclose(s.tension, T, rtol=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_no_tension_no_stiffness(method: str) -> None:
    """Across a pair without tension nothing holds."""
    m = hanging([(-1.2, 0, 0), (0.8, 0, 0)], elasticity=EA)
    s = m.solve((0, 0, 0), method=method)
    assert s.status == Status.SINGULAR
    assert s.flags & Flag.SLACK


@pytest.mark.parametrize("method", METHODS)
def test_slack_at_zero_of_the_null_space(method: str) -> None:
    """Fixed lengths: the second cable's tension is T - k2/(k1 + k2) F, and slack just beyond its zero."""
    m = hanging([(-1.2, 0, 0), (0.8, 0, 0)], stiffness=1e5, pretension=T)
    limit = 2 * T
    for share, slack in ((0.5, False), (1 - 1e-9, False), (1 + 1e-9, True), (1.5, True)):
        s = m.solve((0, 0, 0), [share * limit, 0, 0, 0, 0, 0], method=method)
        assert s.status == Status.CONVERGED
        assert bool(s.flags & Flag.SLACK) == slack
        expected = [T + share * limit / 2, T - share * limit / 2] if not slack else [share * limit, 0]
        np.testing.assert_allclose(s.tension, expected, rtol=1e-9, atol=1e-6)
        u = share * limit / 2e5 if not slack else share * limit / 1e5 - T / 1e5
        np.testing.assert_allclose(s.displacement[0], u, rtol=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_planar_frame(method: str) -> None:
    """Four cables from the corners of a frame: sum of k u u' + T/L (1 - u u')."""
    corners = np.array([(-1.5, 1, 0), (1.5, 1, 0), (-1.5, -1, 0), (1.5, -1, 0)])
    m = hanging([tuple(c) for c in corners], freedoms=("x", "y"), elasticity=EA, pretension=T)
    for p in ((0, 0, 0), (0.4, -0.3, 0)):
        s = m.solve(p, method=method)
        d = np.array(p) - corners
        length = np.linalg.norm(d, axis=1)
        u = d / length[:, None]
        # In equilibrium under its pretension it stays only at the centre; elsewhere it moves until forces balance.
        q = np.array(p) + s.displacement[:3]
        d = q - corners
        now = np.linalg.norm(d, axis=1)
        u, free = d / now[:, None], length / (1 + T / EA)
        tension = EA * (now - free) / free
        assert np.abs((tension[:, None] * u).sum(0)).max() < 1e-9
        np.testing.assert_allclose(s.tension, tension, rtol=1e-10)
        k = sum(
            EA / f * np.outer(e, e) + t / n * (np.eye(3) - np.outer(e, e))
            for e, t, n, f in zip(u, tension, now, free, strict=True)
        )
        np.testing.assert_allclose(np.linalg.inv(s.compliance[:2, :2]), k[:2, :2], rtol=1e-10, atol=1e-6)


def wrapped(anchor: np.ndarray, axis: np.ndarray, radius: float, point: np.ndarray) -> float:
    """Length over a pulley by construction: the shortest of the ways that leave the circle at some angle."""
    d = point - anchor
    h = d @ axis
    across = d - h * axis
    e = across / np.linalg.norm(across)
    flat = np.array([np.linalg.norm(across), h])
    centre = np.array([radius, 0.0])
    low, high = 0.0, 2 * np.pi
    angle = np.linspace(low, high, 200001)
    on = centre + radius * np.stack([-np.cos(angle), np.sin(angle)], -1)
    out = np.stack([np.sin(angle), np.cos(angle)], -1)
    to = flat - on
    # tangent where the rest of the way has the direction of the circle
    cross = out[:, 0] * to[:, 1] - out[:, 1] * to[:, 0]
    ahead = (out * to).sum(-1) > 0
    i = np.flatnonzero((np.sign(cross[1:]) != np.sign(cross[:-1])) & ahead[1:] & ahead[:-1])[0]
    share = cross[i] / (cross[i] - cross[i + 1])
    a = angle[i] + share * (angle[1] - angle[0])
    end = centre + radius * np.array([-np.cos(a), np.sin(a)])
    assert e @ axis < 1e-12
    return float(radius * a + np.linalg.norm(flat - end))


def test_pulley() -> None:
    """Winch lengths over a turning pulley against a numeric construction."""
    anchor, radius = np.array([-2.0, 0.5, 3.0]), 0.06
    m = hanging([tuple(anchor)] * 1, elasticity=EA, radius=radius, mass=5.0, gravity=(0, 0, -9.81))
    for p in ((0, 0, 0), (0.3, -0.4, 1.0), (-1.0, 0.2, 4.0)):
        found = inverse_kinematics(m, p).actuators[..., 0]
        np.testing.assert_allclose(
            found, wrapped(anchor, np.array([0, 0, 1.0]), radius, np.array(p)), rtol=1e-9
        )


@pytest.mark.parametrize("radius", [0.0, 0.08])
def test_stiffness_is_the_slope_of_the_force(radius: float) -> None:
    """Central differences of displacement by force, also over pulleys, with order 2."""
    rng = np.random.default_rng(3)
    anchors = [(sx * 2.0, sy * 1.5, z) for z in (0.0, 2.0) for sx in (-1, 1) for sy in (-1, 1)]
    at = [tuple(rng.uniform(-0.2, 0.2, 3)) for _ in anchors]
    m = hanging(
        anchors,
        at=at,
        freedoms=("x", "y", "z", "rx", "ry", "rz"),
        home=(0.0, 0.0, 1.0),
        elasticity=EA,
        pretension=T,
        radius=radius,
        mass=10.0,
        gravity=(0, 0, -9.81),
    )
    p, w = np.array([0.2, -0.1, 1.1]), np.array([20.0, -30, 10, 0, 0, 0])
    for method in METHODS:
        s = m.solve(p, w, method=method)
        assert s.status == Status.CONVERGED
        errors = []
        for h in (0.5, 0.25):
            steps = np.concatenate([np.eye(6)[:3] * h, -np.eye(6)[:3] * h]) + w
            d = m.solve(np.broadcast_to(p, (6, 3)), steps, method=method).displacement
            slope = (d[:3] - d[3:]).T[:3] / (2 * h)
            errors.append(np.abs(slope - s.compliance[:3, :3]).max() / np.abs(s.compliance[:3, :3]).max())
        assert errors[1] < 1e-5
        assert 3.5 < errors[0] / errors[1] < 4.5


def test_forward_kinematics_of_more_winches_than_freedoms() -> None:
    """Eight free lengths lead back to the pose; eight that do not go together lead nowhere."""
    anchors = [(sx * 2.0, sy * 1.5, z) for z in (0.0, 2.0) for sx in (-1, 1) for sy in (-1, 1)]
    at = [(0.3 * np.sign(a[0]), 0.1 * np.sign(a[1]), 0.15 - 0.15 * a[2]) for a in anchors]
    m = hanging(
        anchors,
        at=[tuple(map(float, p)) for p in at],
        freedoms=("x", "y", "z", "rx", "ry", "rz"),
        home=(0.0, 0.0, 1.0),
        elasticity=EA,
        pretension=T,
    )
    p = np.array([0.2, -0.1, 1.1])
    lengths = inverse_kinematics(m, p).actuators
    np.testing.assert_allclose(forward_kinematics(m, lengths).position, p, atol=1e-12)
    assert forward_kinematics(m, lengths + 0.05 * np.eye(8)[0]).status == Status.UNREACHABLE
