"""Imposed displacements, equation (10)."""

from __future__ import annotations

import numpy as np
import pytest
from tests.python.solve import builders as b

import stiffmap as sm
from stiffmap.model.description import Pose

POSES = {
    "orthoglide-revised": [[0.05, -0.1, 0.15], [-0.1, 0.1, 0.2]],
    "hexapod": [[0.1, 0.05, 0.68], [0, -0.1, 0.75]],
    "hybrid": [[0.1, 0.05, 0.3], [-0.1, 0.0, 0.25]],
    "swing-table": [[0.1, 0, 0.4], [-0.15, 0, 0.4]],
    "ur10": [[-0.8, 0.1, 0.3], [-0.7, -0.1, 0.2]],
}
WRENCH = np.array([300.0, -200, 400, 20, -30, 10])


@pytest.mark.parametrize("name", POSES)
def test_it_undoes_solve(name: str) -> None:
    machine = sm.load_machine(name)
    position = np.array(POSES[name])
    wrench = 0.1 * WRENCH if name in ("ur10", "swing-table") else WRENCH
    driven = machine.solve(position, wrench, method="reference")
    held = machine.wrench(position, driven.displacement)
    assert (held.status == sm.Status.CONVERGED).all()
    scale = np.abs(wrench).max()
    np.testing.assert_allclose(held.wrench, np.broadcast_to(wrench, (2, 6)), rtol=0, atol=1e-6 * scale)
    np.testing.assert_allclose(held.leg_wrench, driven.leg_wrench, rtol=0, atol=1e-5 * scale)
    np.testing.assert_allclose(held.actuator_effort, driven.actuator_effort, rtol=0, atol=1e-5 * scale)
    k = np.abs(driven.stiffness).max(axis=(-1, -2), keepdims=True)
    np.testing.assert_allclose(held.stiffness / k, driven.stiffness / k, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(held.force_status, driven.status)


@pytest.mark.parametrize("name", ["orthoglide-revised", "hexapod", "swing-table"])
def test_legs_are_the_derivatives_of_their_wrenches(name: str) -> None:
    machine = sm.load_machine(name)
    p = POSES[name][0]
    d = np.array([2e-4, -1e-4, 3e-4, 2e-4, 1e-4, -2e-4])
    held = machine.wrench(p, d)
    assert held.ok
    k = np.abs(held.stiffness).max()
    np.testing.assert_allclose(held.leg_stiffness.sum(-3) / k, held.stiffness / k, rtol=0, atol=1e-9)

    def legs(twist: np.ndarray) -> np.ndarray:
        # twist: of the held frame in base axes, so the rotation is composed, not added
        from scipy.spatial.transform import Rotation

        turned = Rotation.from_rotvec(twist[3:]) * Rotation.from_rotvec(d[3:])
        return machine.wrench(p, np.r_[d[:3] + twist[:3], turned.as_rotvec()]).leg_wrench

    errors = []
    for h in (4e-5, 2e-5):
        steps = [h * e for e in np.eye(6)]
        numeric = np.stack([(legs(e) - legs(-e)) / (2 * h) for e in steps], -1)
        errors.append(np.abs(numeric + held.leg_stiffness).max() / k)
    assert errors[1] < 1e-5
    assert errors[1] < errors[0] / 3 or errors[1] < 1e-8  # second order


def test_where_forces_have_no_answer() -> None:
    """A parallelogram is free across its bars: no displacement under a force, but a wrench for each pose."""
    stiff = np.linalg.inv(b.cantilever_compliance(0.775, 2e8, 3e4, 1.5e4))
    machine = b.parallelogram(stiff, 0.25, 0.775, 0.3)
    home = machine.description.home.p
    assert machine.solve(home, [0, 0, 10, 0, 0, 0]).status == sm.Status.SINGULAR
    along_the_bars = np.array([np.cos(0.3), 0, -np.sin(0.3)])
    held = machine.wrench(home, np.r_[1e-5 * along_the_bars, 0, 0, 0])
    assert held.status == sm.Status.CONVERGED
    np.testing.assert_allclose(held.wrench[:3], 2 * stiff[0, 0] * 1e-5 * along_the_bars, rtol=1e-6, atol=1e-6)
    assert np.isfinite(held.leg_stiffness).all()


def test_rigid_parts_forbid_a_displacement() -> None:
    machine = b.serial(b.motor("drive", law=b.Law(1e3)), b.shift("arm", (1, 0, 0)), home=Pose.of((1, 0, 0)))
    a = 0.01
    turned = machine.wrench((1, 0, 0), [np.cos(a) - 1, np.sin(a), 0, 0, 0, a])
    assert turned.ok and int(turned.flags) & sm.Flag.RIGID_DIRECTION
    np.testing.assert_allclose(turned.actuator_effort, -1e3 * a, rtol=1e-9)
    assert np.isnan(turned.wrench).all()  # a force and a moment may share the drive's torque at will
    stretched = machine.wrench((1, 0, 0), [1e-3, 0, 0, 0, 0, 0])
    assert stretched.status == sm.Status.NOT_CONVERGED
    assert np.isnan(stretched.wrench).all()


def test_bad_input() -> None:
    machine = sm.load_machine("five-bar")
    with pytest.raises(sm.StiffmapError, match="displacement: expected"):
        machine.wrench([0, 0.416, 0], [1e-3, 0, 0])
    with pytest.raises(sm.StiffmapError, match="point: expected one of tcp"):
        machine.wrench([0, 0.416, 0], np.zeros(6), point="nose")
    far = machine.wrench([5, 5, 0], np.zeros(6))
    assert far.status == sm.Status.UNREACHABLE and np.isnan(far.wrench).all()


@pytest.mark.parametrize("name", ["ur10", "five-bar"])
def test_a_machine_with_few_loops_is_held(name: str) -> None:
    """Back to the displacement that the wrench causes; a serial arm has no loop but that of the clamp."""
    machine = sm.load_machine(name)
    home = machine.description.home.p
    d = machine.solve(home, [20.0, 10.0, 0, 0, 0, 0]).displacement
    held = machine.wrench(home, d)
    assert held.ok
    back = machine.solve(home, np.nan_to_num(held.wrench))
    np.testing.assert_allclose(back.displacement[:3], d[:3], atol=1e-9)
