"""What defines an equilibrium: forces balance, work balances, efforts follow from the Jacobian."""

from __future__ import annotations

import numpy as np
import pytest
from tests.python.solve.sampling import poses, wrenches

import stiffmap as sm

METHODS = ("fast", "reference")


@pytest.mark.parametrize("method", METHODS)
def test_leg_wrenches_sum_to_minus_the_load(shipped: sm.Machine, method: str) -> None:
    load = wrenches(10, 1)
    s = shipped.solve(poses(shipped, 10, 2), load, method=method)
    np.testing.assert_allclose(s.leg_wrench.sum(axis=-2), -load, atol=1e-6)


def test_drives_follow_from_the_inverse_jacobian(orthoglide: sm.Machine) -> None:
    """Unloaded limit: drive on the leg = -J^T F with J from actuators to platform (springs locked)."""
    at, force = poses(orthoglide, 6, 3), wrenches(6, 4, 1.0, 0.0)
    x, y, z = at.T
    length = 0.775
    sx, sy, sz = (np.sqrt(length**2 - a**2 - b**2) for a, b in ((y, z), (z, x), (x, y)))
    one = np.ones_like(x)
    inverse = np.array([[one, y / sx, z / sx], [x / sy, one, z / sy], [x / sz, y / sz, one]])
    jacobian = np.linalg.inv(np.moveaxis(inverse, -1, 0))
    effort = orthoglide.solve(at, force).actuator_effort
    wanted = -np.einsum("nji,nj->ni", jacobian, force[:, :3])
    np.testing.assert_allclose(effort, wanted, rtol=1e-3, atol=1e-3)


def test_actuator_deflection_carries_the_effort(orthoglide: sm.Machine) -> None:
    s = orthoglide.solve((0.1, -0.05, 0.2), (300, -200, 500, 10, 20, -30))
    commanded = sm.inverse_kinematics(orthoglide, (0.1, -0.05, 0.2)).actuators
    moved = np.array([s.joint_coordinates[n] for n in orthoglide.actuators])
    np.testing.assert_allclose((moved - commanded) / 1.4e-7, -s.actuator_effort, rtol=1e-8)


@pytest.mark.parametrize("method", METHODS)
def test_work_of_the_load_is_stored_in_the_springs(orthoglide: sm.Machine, method: str) -> None:
    """Work along the load path (Simpson) = energy of all springs and drives, for forces."""
    at, force = np.array([-0.1, 0.2, 0.05]), np.array([900.0, -600.0, 1500.0, 0, 0, 0])
    shares = np.linspace(0, 1, 41)
    path = orthoglide.solve(at, shares[:, None] * force, method=method)
    along = path.displacement @ force
    work = shares[-1] * along[-1] - integrate(along, shares)
    end = orthoglide.solve(at, force, method=method)
    energy = sum(
        0.5 * d @ springs(orthoglide)[name.rsplit(".", 1)[-1]] @ d
        for name, d in end.spring_deflection.items()
    )
    energy += 0.5 * 1.4e-7 * float((end.actuator_effort**2).sum())
    assert work == pytest.approx(energy, rel=1e-9)


def springs(machine: sm.Machine) -> dict[str, np.ndarray]:
    """Stiffness of the Orthoglide's foot and bar."""
    found: dict[str, np.ndarray] = {}

    def look(elements: tuple[object, ...]) -> None:
        for e in elements:
            for branch in getattr(e, "branches", ()):
                look(branch.elements)
            if getattr(e, "compliance", None) is not None:
                found[e.name] = np.linalg.inv(np.array(e.compliance))  # type: ignore[attr-defined]

    look(machine.description.legs[0].elements)
    return found


def integrate(values: np.ndarray, x: np.ndarray) -> float:
    h = x[1] - x[0]
    return float(h / 3 * (values[0] + values[-1] + 4 * values[1:-1:2].sum() + 2 * values[2:-1:2].sum()))


def test_no_load_no_displacement(shipped: sm.Machine) -> None:
    s = shipped.solve(poses(shipped, 5, 6))
    assert np.abs(s.displacement).max() < 1e-14
    assert np.abs(s.leg_wrench).max() < 1e-6
    assert (s.status == sm.Status.CONVERGED).all()


@pytest.mark.parametrize("method", METHODS)
def test_leg_order_does_not_matter(orthoglide: sm.Machine, method: str) -> None:
    from dataclasses import replace

    d = orthoglide.description
    other = sm.Machine(replace(d, legs=(d.legs[2], d.legs[0], d.legs[1])))
    at, load = poses(orthoglide, 8, 7), wrenches(8, 8)
    a, b = (m.solve(at, load, method=method) for m in (orthoglide, other))
    np.testing.assert_allclose(b.displacement, a.displacement, rtol=1e-9, atol=1e-13)
    np.testing.assert_allclose(b.compliance, a.compliance, rtol=1e-8, atol=1e-15)
    np.testing.assert_allclose(b.leg_wrench[:, [1, 2, 0]], a.leg_wrench, rtol=1e-6, atol=1e-6)


def test_load_steps_do_not_change_the_answer(orthoglide: sm.Machine) -> None:
    load = (2000.0, 2000.0, 0, 0, 0, 0)
    a = orthoglide.solve((-0.2, -0.2, -0.2), load)
    b = orthoglide.solve((-0.2, -0.2, -0.2), load, load_steps=9)
    np.testing.assert_allclose(b.displacement, a.displacement, rtol=1e-9, atol=1e-14)


def test_threads_do_not_change_a_bit(shipped: sm.Machine) -> None:
    at, load = poses(shipped, 70, 9), wrenches(70, 10)
    a, b = (shipped.solve(at, load, threads=n) for n in (1, 7))
    for name in ("displacement", "stiffness", "compliance", "leg_wrench", "actuator_effort", "coordinates"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
