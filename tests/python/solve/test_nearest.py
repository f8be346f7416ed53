"""A pose that leaves joints open is reached in the configuration nearest to home (theory C11), on every way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import null_space
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation
from tests.python.solve.redundant_machines import ARMS, Arm

import stiffmap as sm
from stiffmap.model.description import Spring
from stiffmap.workspace.performance.motion.closing import drive_kinematics

WRENCH = np.array([40.0, -30.0, 60.0, 2.0, 3.0, -1.0])


@pytest.fixture(scope="module", params=list(ARMS))
def arm(request: pytest.FixtureRequest) -> Arm:
    return ARMS[request.param]()


def poses(arm: Arm, count: int = 40, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Positions in the box, and rotations of up to 15 degrees from home's that the task allows."""
    rng = np.random.default_rng(seed)
    low, high = (np.array(v) for v in arm.machine.workspace)
    turns = rng.uniform(-0.15, 0.15, (count, 3))
    if "rx" not in arm.machine.description.task:
        turns[:, :2] = 0.0
    _, r = arm.tip(arm.home)
    return rng.uniform(low, high, (count, 3)), Rotation.from_rotvec(turns).as_matrix() @ r


def joints(arm: Arm, coordinates: np.ndarray) -> np.ndarray:
    return coordinates[..., list(arm.machine.compiled.drives)]


def test_the_machines_are_redundant(arm: Arm) -> None:
    assert arm.machine.compiled.core.redundancy == len(arm.home) - len(arm.machine.description.task)


def test_shipped_machines_are_not() -> None:
    for name in sm.machine_names():
        assert sm.load_machine(name).compiled.core.redundancy == 0, name


def test_joints_are_a_stationary_point_of_the_distance(arm: Arm) -> None:
    """With kinematics of the test's own: the pose is met, and the way home is normal to all motions that keep it."""
    p, r = poses(arm)
    k = sm.inverse_kinematics(arm.machine, p, r)
    assert not k.status.any()
    rows = ["x", "y", "z", "rx", "ry", "rz"]
    wanted = [rows.index(t) for t in arm.machine.description.task]
    for q, at, turn in zip(joints(arm, k.coordinates), p, r, strict=True):
        tip, rotation = arm.tip(q)
        np.testing.assert_allclose(tip, at, atol=1e-11)
        np.testing.assert_allclose(rotation, turn, atol=1e-11)
        j = arm.jacobian(q)[wanted] / arm.units
        still = null_space(j, rcond=1e-6)
        assert still.shape[1] == len(arm.home) - len(wanted)
        np.testing.assert_allclose(still.T @ (arm.units * (q - arm.home)), 0.0, atol=3e-9)


def test_no_configuration_near_by_is_nearer(arm: Arm) -> None:
    p, r = poses(arm, 4, seed=5)
    k = sm.inverse_kinematics(arm.machine, p, r)

    def gap(q: np.ndarray, at: np.ndarray, turn: np.ndarray) -> np.ndarray:
        tip, rotation = arm.tip(q)
        return np.concatenate([tip - at, Rotation.from_matrix(rotation @ turn.T).as_rotvec()])[
            [0, 1, 5] if len(arm.home) == 4 else slice(None)
        ]

    for q, at, turn in zip(joints(arm, k.coordinates), p, r, strict=True):
        found = minimize(
            lambda x: 0.5 * np.sum((arm.units * (x - arm.home)) ** 2),
            q + 0.02 * np.random.default_rng(3).normal(size=len(q)),
            constraints={"type": "eq", "fun": gap, "args": (at, turn)},
            method="SLSQP",
            options={"ftol": 1e-15, "maxiter": 300},
        )
        np.testing.assert_allclose(found.x, q, atol=2e-6)


def test_every_way_leads_to_the_same_joints(arm: Arm) -> None:
    p, r = poses(arm)
    m = arm.machine
    wanted = joints(arm, sm.inverse_kinematics(m, p, r).coordinates)
    fast, slow = (m.solve(p, WRENCH, rotation=r, method=way) for way in ("fast", "reference"))
    assert m.fast == "" and not fast.status.any() and not slow.status.any()
    assert not (fast.flags & sm.Flag.BRANCH_UNVERIFIED).any()
    for s in (fast, slow):
        still = m.solve(p, np.zeros(6), rotation=r, method="fast" if s is fast else "reference")
        np.testing.assert_allclose(joints(arm, still.coordinates), wanted, atol=1e-9)
    size = np.abs(slow.displacement).max(axis=0)
    assert (np.abs(fast.displacement - slow.displacement) <= 1e-9 * size + 1e-18).all()
    np.testing.assert_allclose(
        fast.compliance, slow.compliance, rtol=0, atol=1e-9 * np.abs(slow.compliance).max()
    )
    measured = drive_kinematics(m, p, r)
    np.testing.assert_allclose(measured.actuators, wanted, atol=1e-9)


def test_the_batch_has_no_say(arm: Arm) -> None:
    p, r = poses(arm)
    m = arm.machine
    together = m.solve(p, WRENCH, rotation=r)
    order = np.random.default_rng(2).permutation(len(p))
    shuffled = m.solve(p[order], WRENCH, rotation=r[order])
    np.testing.assert_allclose(shuffled.coordinates, together.coordinates[order], rtol=0, atol=1e-12)
    for i in (0, 7, 23):
        alone = m.solve(p[i], WRENCH, rotation=r[i])
        np.testing.assert_allclose(alone.coordinates, together.coordinates[i], rtol=0, atol=1e-12)
    chain = drive_kinematics(m, p[order], r[order])
    np.testing.assert_allclose(chain.actuators, drive_kinematics(m, p, r).actuators[order], atol=1e-10)


def test_joints_are_continuous_over_a_map(arm: Arm) -> None:
    """Halving the grid's step halves the steps of the joints, and second differences fall fourfold."""
    low, high = (np.array(v) for v in arm.machine.workspace)

    def steps(n: int) -> tuple[float, float]:
        x, y = np.meshgrid(np.linspace(low[0], high[0], n), np.linspace(low[1], high[1], n), indexing="ij")
        at = np.stack([x, y, np.full_like(x, (low[2] + high[2]) / 2)], axis=-1)
        q = joints(arm, arm.machine.solve(at, np.zeros(6)).coordinates) * arm.units
        return float(np.abs(np.diff(q, axis=0)).max()), float(np.abs(np.diff(q, n=2, axis=0)).max())

    coarse, fine = steps(21), steps(41)
    assert fine[0] < 0.6 * coarse[0]
    assert fine[1] < 0.35 * coarse[1]


def test_a_start_takes_the_place_of_home(arm: Arm) -> None:
    """Nearest to the start's joints; a start along the self-motion gives another configuration of the same pose."""
    m, units = arm.machine, arm.units
    p, r = poses(arm, 6, seed=9)
    q = joints(arm, sm.inverse_kinematics(m, p, r).coordinates)
    other = arm.home + 0.15 * np.cos(np.arange(len(arm.home)))
    start = dict(zip(m.actuators, other, strict=True))
    k = sm.inverse_kinematics(m, p, r, start=start)
    s = m.solve(p, np.zeros(6), rotation=r, start=start)
    assert not k.status.any() and not s.status.any()
    found = joints(arm, k.coordinates)
    np.testing.assert_allclose(joints(arm, s.coordinates), found, atol=1e-9)
    assert np.abs(found - q).max() > 1e-3
    near, home = (np.linalg.norm(units * (v - other), axis=-1) for v in (found, q))
    assert (near < home).all()
    task = [["x", "y", "z", "rx", "ry", "rz"].index(t) for t in m.description.task]
    for at in found:
        still = null_space(arm.jacobian(at)[task] / units, rcond=1e-6)
        np.testing.assert_allclose(still.T @ (units * (at - other)), 0.0, atol=3e-9)


def test_a_leg_in_a_plane_closes_in_the_lanes_too() -> None:
    """All six components of the pose are commanded, of which the leg's plane keeps three for all of its four joints."""
    arm = ARMS["planar_four"]()
    d = arm.machine.description
    (leg,) = d.legs
    spring = Spring("link", stiffness=tuple(map(tuple, np.diag([2e6, 2e6, 1e6, 2e4, 2e4, 3e4]).tolist())))
    task = ("x", "y", "z", "rx", "ry", "rz")
    m = sm.Machine(replace(d, legs=(replace(leg, elements=(*leg.elements, spring)),), task=task))
    p, r = poses(arm)
    fast, slow = (m.solve(p, WRENCH, rotation=r, method=way) for way in ("fast", "reference"))
    assert m.compiled.core.redundancy == 1 and not slow.status.any() and not fast.status.any()
    assert not (fast.flags & sm.Flag.REFERENCE_PATH).any()
    np.testing.assert_allclose(
        joints(arm, m.solve(p, np.zeros(6), rotation=r).coordinates),
        joints(arm, arm.machine.solve(p, np.zeros(6), rotation=r).coordinates),
        atol=1e-10,
    )
    np.testing.assert_allclose(fast.displacement, slow.displacement, rtol=0, atol=1e-13)
    out_of_the_plane = m.solve(p + [0.0, 0.0, 1e-4], WRENCH, rotation=r)
    assert (out_of_the_plane.status == sm.Status.UNREACHABLE).all()
