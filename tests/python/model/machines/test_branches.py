"""Assembly modes by a start of the closure, and equilibria at commanded joints."""

from __future__ import annotations

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.model.files.shipped import machine_names
from stiffmap.solve.kinematics import forward_kinematics, inverse_kinematics

NAMES = machine_names()
WRENCH = np.array([3.0, -2.0, 5.0, 0.02, -0.01, 0.03])


def poses(machine: sm.Machine, n: int = 4) -> np.ndarray:
    low, high = machine.workspace
    return np.random.default_rng(5).uniform(low + 0.1 * (high - low), high - 0.1 * (high - low), (n, 3))


@pytest.mark.parametrize("name", NAMES)
def test_commanded_joints_are_the_same_equilibrium_as_the_commanded_pose(name: str) -> None:
    machine = sm.load_machine(name)
    p = poses(machine)
    by_pose = machine.solve(p, WRENCH)
    joints = inverse_kinematics(machine, p).actuators
    for method in ("fast", "reference"):
        by_joints = machine.solve_joints(joints, WRENCH, method=method)
        assert by_joints.unloaded is not None
        np.testing.assert_array_equal(by_joints.status, by_pose.status)
        scale = np.abs(by_pose.displacement).max()
        np.testing.assert_allclose(by_joints.displacement, by_pose.displacement, rtol=0, atol=1e-8 * scale)
        tcp = forward_kinematics(machine, joints)
        np.testing.assert_allclose(by_joints.unloaded.position, tcp.position, rtol=0, atol=1e-14)


@pytest.mark.parametrize("name", NAMES)
def test_a_start_on_the_mode_of_home_changes_nothing(name: str) -> None:
    machine = sm.load_machine(name)
    p = poses(machine)
    plain = machine.solve(p, WRENCH)
    near = machine.solve(
        p, WRENCH, start=plain.coordinates
    )  # loaded coordinates: not closed, springs deflected
    np.testing.assert_array_equal(near.status, plain.status)
    scale = np.abs(plain.displacement).max()
    np.testing.assert_allclose(near.displacement, plain.displacement, rtol=0, atol=1e-8 * scale)


def test_the_other_elbow_of_an_arm() -> None:
    """Upper arm and forearm (612 and 572.3 mm) mirrored on the line from shoulder to wrist, the wrist turned back."""
    machine = sm.load_machine("ur10")
    p = poses(machine, 1)[0]
    q = inverse_kinematics(machine, p).actuators
    lean = np.arctan2(572.3 * np.sin(q[2]), 612 + 572.3 * np.cos(q[2]))
    flipped = q + [0, 2 * lean, -2 * q[2], 2 * (q[2] - lean), 0, 0]
    assert np.allclose(forward_kinematics(machine, flipped).position, p, atol=1e-12)
    rough = dict(zip(machine.actuators, flipped + 0.05, strict=True))
    found = machine.solve(p, WRENCH, start=rough)
    assert found.status == sm.Status.CONVERGED
    assert found.unloaded is not None
    np.testing.assert_allclose(found.unloaded.actuators, flipped, atol=1e-9)
    home = machine.solve(p, WRENCH)
    reference = machine.solve(p, WRENCH, start=rough, method="reference")
    np.testing.assert_allclose(found.displacement, reference.displacement, rtol=0, atol=1e-14)
    assert np.abs(found.compliance - home.compliance).max() > 1e-3 * np.abs(home.compliance).max()


def test_the_other_elbow_of_a_five_bar() -> None:
    machine = sm.load_machine("five-bar")
    p = poses(machine, 1)[0]
    here = inverse_kinematics(machine, p)
    joints = dict(zip(machine.solve(p).joint_index, machine.solve(p).joint_index.values(), strict=True))
    elbow = next(n for n in joints if n.startswith("right") and n.endswith("elbow"))
    motor, pin = elbow.replace("elbow", "motor"), elbow.replace("elbow", "pin")
    bend = here.coordinates[joints[elbow]]
    start = {n: here.coordinates[i] for n, i in joints.items()}
    # Mirror the right arm on the line from its motor to its pin: link lengths 300 and 374 mm.
    lean = np.arctan2(374 * np.sin(bend), 300 + 374 * np.cos(bend))
    start |= {motor: start[motor] + 2 * lean, elbow: -bend, pin: start[pin] + 2 * (bend - lean)}
    other = inverse_kinematics(machine, p, start=start)
    assert other.status == sm.Status.CONVERGED
    np.testing.assert_allclose(other.coordinates[joints[elbow]], -bend, atol=1e-9)
    np.testing.assert_allclose(other.position, p * [1, 1, 0] + other.position * [0, 0, 1], atol=1e-12)


def test_joints_that_do_not_go_together_are_unreachable() -> None:
    machine = sm.load_machine("orthoglide-revised")
    home = inverse_kinematics(machine, machine.description.home.p).actuators
    s = machine.solve_joints(np.stack([home, home + [5.0, 0, 0]]))
    assert s.status.tolist() == [sm.Status.CONVERGED, sm.Status.UNREACHABLE]
    assert np.isnan(s.displacement[1]).all()


def test_unknown_joints_and_wrong_sizes_are_one_clear_error() -> None:
    machine = sm.load_machine("ur10")
    p = machine.workspace.mean(0)
    with pytest.raises(sm.StiffmapError, match=r"start: expected joints among .*got 'elbow_9'"):
        machine.solve(p, start={"elbow_9": 1.0})
    with pytest.raises(sm.StiffmapError, match="start: expected 6 coordinates"):
        machine.solve(p, start=[1.0, 2.0])
    with pytest.raises(sm.StiffmapError, match="actuators: expected 6 actuator coordinates"):
        machine.solve_joints([0.0])
