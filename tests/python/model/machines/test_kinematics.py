"""Drive coordinates of the shipped machines against geometry that a person would write down."""

from __future__ import annotations

import numpy as np
import pytest
from tests.python.model.machines import machine_cases as cases

import stiffmap as sm

TIGHT = {"rtol": 0, "atol": 1e-11}


def drives(name: str) -> tuple[np.ndarray, np.ndarray]:
    machine = sm.load_machine(name)
    p = cases.box(machine)
    k = sm.inverse_kinematics(machine, p)
    assert (k.status == sm.Status.CONVERGED).all()
    return p, k.actuators


def test_hexapod_struts_are_distances() -> None:
    machine = sm.load_machine("hexapod")
    p = cases.box(machine)
    r = cases.turn("x", 0.1) @ cases.turn("y", -0.15) @ cases.turn("z", 0.2)
    on = np.radians([-15, 15, 105, 135, 225, 255])
    at = np.radians([-45, 45, 75, 165, 195, 285])
    base = 0.5 * np.stack([np.cos(on), np.sin(on), 0 * on], 1)
    plate = 0.25 * np.stack([np.cos(at), np.sin(at), 0 * at], 1)
    for turned in (np.eye(3), r):
        k = sm.inverse_kinematics(machine, p, turned)
        wanted = np.linalg.norm(p[:, None] + plate @ turned.T - base, axis=2)
        np.testing.assert_allclose(k.actuators, wanted, **TIGHT)


@pytest.mark.parametrize(("name", "reach", "length"), [("linear-delta", 0.3, 0.5), ("hybrid", 0.6, 1.0)])
def test_linear_delta_carriages(name: str, reach: float, length: float) -> None:
    p, got = drives(name)
    towers = reach * np.array([[np.cos(a), np.sin(a)] for a in np.radians([210, 330, 90])])
    across = np.linalg.norm(p[:, None, :2] - towers, axis=2)
    tool = 0.2 if name == "hybrid" else 0.0
    np.testing.assert_allclose(got[:, :3], p[:, None, 2] + tool + np.sqrt(length**2 - across**2), **TIGHT)


def test_rotary_delta_cranks_reach_the_rods() -> None:
    p, got = drives("rotary-delta")
    for i, a in enumerate(np.radians([0, 120, 240])):
        q = got[:, i]
        out = 0.2 + 0.35 * np.cos(q) - 0.07
        elbow = np.stack([out * np.cos(a), out * np.sin(a), -0.35 * np.sin(q)], 1)
        np.testing.assert_allclose(np.linalg.norm(p - elbow, axis=1), 0.8, **TIGHT)
        assert (np.abs(q) < np.radians(70)).all()  # cranks outwards


def test_five_bar_arms_reach_the_tip() -> None:
    p, got = drives("five-bar")
    for i, side in enumerate((-1, 1)):
        elbow = np.stack([side * 0.15 + 0.3 * np.cos(got[:, i]), 0.3 * np.sin(got[:, i])], 1)
        np.testing.assert_allclose(np.linalg.norm(p[:, :2] - elbow, axis=1), 0.374, **TIGHT)
        assert (side * elbow[:, 0] > side * p[:, 0]).all()  # elbows outwards


def test_swing_table_swings_on_a_circle() -> None:
    machine = sm.load_machine("swing-table")
    x = np.linspace(-0.2, 0.2, 5)
    k = sm.inverse_kinematics(machine, np.stack([x, 0 * x, 0.4 + 0 * x], 1))
    np.testing.assert_allclose(np.sin(k.actuators[:, 0]), x / 0.4, **TIGHT)
    np.testing.assert_allclose(k.position[:, 2], np.sqrt(0.16 - x**2), **TIGHT)
    np.testing.assert_allclose(k.rotation, np.broadcast_to(np.eye(3), (5, 3, 3)), **TIGHT)


@pytest.mark.parametrize(("a", "b"), [(0.0, 0.0), (0.2, -0.15), (-0.1, 0.25)])
@pytest.mark.parametrize("z", [0.55, 0.65])
def test_3rps_balls_stay_in_the_planes_of_their_pins(a: float, b: float, z: float) -> None:
    """Height and direction are as commanded; shift and turn are those that keep each ball in its plane
    (K.-M. Lee and D. K. Shah, 1988); the drives are the distances from the pins to the balls."""
    machine = sm.load_machine("3-rps")
    wanted = cases.turn("x", a) @ cases.turn("y", b)
    k = sm.inverse_kinematics(machine, [0, 0, z], wanted)
    assert k.status == sm.Status.CONVERGED
    np.testing.assert_allclose(k.rotation[:, 2], wanted[:, 2], **TIGHT)
    assert k.position[2] == pytest.approx(z, abs=1e-12)
    for i, angle in enumerate(np.radians([0, 120, 240])):
        out = np.array([np.cos(angle), np.sin(angle), 0])
        ball = k.position + k.rotation @ (0.2 * out)
        assert ball @ [-out[1], out[0], 0] == pytest.approx(0, abs=1e-12)
        assert np.linalg.norm(ball - 0.375 * out) == pytest.approx(k.actuators[i], abs=1e-11)


DH = np.array([  # d, a, alpha: the maker's table of the UR10 (CB3)
    [0.1273, 0, np.pi / 2], [0, -0.612, 0], [0, -0.5723, 0],
    [0.163941, 0, np.pi / 2], [0.1157, 0, -np.pi / 2], [0.0922, 0, 0],
])  # fmt: skip


def dh_frames(q: np.ndarray) -> list[np.ndarray]:
    """Frames 0 to 6 of the Denavit-Hartenberg chain."""
    frames = [np.eye(4)]
    for (d, a, alpha), angle in zip(DH, q, strict=True):
        t = np.eye(4)
        t[:3, :3] = cases.turn("z", angle) @ cases.turn("x", alpha)
        t[:3, 3] = [a * np.cos(angle), a * np.sin(angle), d]
        frames.append(frames[-1] @ t)
    return frames


def test_ur10_is_the_makers_table() -> None:
    machine = sm.load_machine("ur10")
    rng = np.random.default_rng(1)
    home = np.radians([0, -60, 90, -120, -90, 0])
    for q in home + rng.uniform(-0.5, 0.5, (4, 6)):
        tip = dh_frames(q)[-1]
        k = sm.forward_kinematics(machine, q)
        np.testing.assert_allclose(k.position, tip[:3, 3], **TIGHT)
        np.testing.assert_allclose(k.rotation, tip[:3, :3], **TIGHT)
        back = sm.inverse_kinematics(machine, tip[:3, 3], tip[:3, :3])
        np.testing.assert_allclose(back.actuators, q, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "q", [np.radians([0, -60, 90, -120, -90, 0]), np.radians([20, -75, 70, -100, -70, 30])]
)
def test_ur10_compliance_is_that_of_its_joints(q: np.ndarray) -> None:
    machine = sm.load_machine("ur10")
    frames = dh_frames(q)
    tip = frames[-1]
    j = np.array([np.r_[np.cross(f[:3, 2], tip[:3, 3] - f[:3, 3]), f[:3, 2]] for f in frames[:6]]).T
    c = j @ np.diag([2.5e-5, 2.5e-5, 5e-5, 1.25e-4, 1.25e-4, 1.25e-4]) @ j.T
    got = machine.solve(tip[:3, 3], rotation=tip[:3, :3])
    np.testing.assert_allclose(got.compliance, c, rtol=1e-8, atol=1e-13)


@pytest.mark.parametrize(("a", "b"), [(0.0, 0.0), (0.3, -0.4), (-0.5, 0.2)])
def test_hybrid_head_is_commanded_by_the_direction_of_the_tool(a: float, b: float) -> None:
    machine = sm.load_machine("hybrid")
    p = np.array([0.05, -0.08, 0.32])
    wanted = cases.turn("x", a) @ cases.turn("y", b)
    about_itself = wanted @ cases.turn("z", 0.7)  # not commanded: task [x, y, z, rx, ry]
    for rotation in (wanted, about_itself):
        k = sm.inverse_kinematics(machine, p, rotation)
        assert k.status == sm.Status.CONVERGED
        index = [machine.actuators.index(n) for n in ("a", "b")]
        np.testing.assert_allclose(k.actuators[index], [a, b], **TIGHT)
        np.testing.assert_allclose(k.rotation, wanted, **TIGHT)
        np.testing.assert_allclose(k.position, p, **TIGHT)
        s = machine.solve(p, [100, 0, 0, 0, 0, 0], rotation=rotation)
        assert s.ok and np.abs(s.displacement).max() < 1e-3
