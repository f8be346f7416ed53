"""Loaded stiffness of the shipped machines: against the equilibrium itself, and its (a)symmetry."""

from __future__ import annotations

import numpy as np
import pytest
from tests.python.solve.sampling import cross, poses, relative, twist, wrenches

import stiffmap as sm

METHODS = ("fast", "reference")


def difference(machine: sm.Machine, at: np.ndarray, load: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """(..., 6, 6) central difference of the equilibrium in the wrench, rotations as twists."""
    here = machine.solve(at, load).displacement[:, None]
    change = steps[:, None] * np.eye(6)
    up = machine.solve(at[:, None], load[:, None] + change).displacement
    down = machine.solve(at[:, None], load[:, None] - change).displacement
    moved = (twist(up, here) - twist(down, here)) / (2 * steps[:, :, None])
    return np.swapaxes(moved, -1, -2)


@pytest.mark.parametrize("method", METHODS)
def test_compliance_is_the_derivative_of_the_equilibrium(shipped: sm.Machine, method: str) -> None:
    at, load = poses(shipped, 4, 1), wrenches(4, 2, 600.0, 40.0)
    compliance = shipped.solve(at, load, method=method).compliance
    steps = 2.5e-4 / np.diagonal(compliance, axis1=-2, axis2=-1)  # moves by 0.25 mm, 0.25 mrad
    coarse, fine = (relative(difference(shipped, at, load, h * steps), compliance) for h in (1, 0.5))
    assert fine < 1e-4
    assert np.log2(coarse / fine) == pytest.approx(2, abs=0.1)


@pytest.mark.parametrize("method", METHODS)
def test_dead_moment_asymmetry(shipped: sm.Machine, method: str) -> None:
    at, load = poses(shipped, 10, 3), wrenches(10, 4, 3000.0, 200.0)
    k = shipped.solve(at, load, method=method).stiffness
    wanted = np.zeros_like(k)
    wanted[:, 3:, 3:] = -cross(load[:, 3:])
    size = np.sqrt(np.diagonal(k, axis1=-2, axis2=-1))
    error = np.abs(k - np.swapaxes(k, -1, -2) - wanted) / (size[:, :, None] * size[:, None, :])
    assert error.max() < 1e-9
    asymmetry = np.abs(wanted) / (size[:, :, None] * size[:, None, :])
    assert asymmetry.max() > 1e-6  # the law is visible, not lost in round-off


@pytest.mark.parametrize("method", METHODS)
def test_symmetric_under_forces_alone(shipped: sm.Machine, method: str) -> None:
    at, load = poses(shipped, 10, 5), wrenches(10, 6, 3000.0, 0.0)
    k = shipped.solve(at, load, method=method).stiffness
    size = np.sqrt(np.diagonal(k, axis1=-2, axis2=-1))
    assert (np.abs(k - np.swapaxes(k, -1, -2)) / (size[:, :, None] * size[:, None, :])).max() < 1e-10


def test_stiffness_and_compliance_are_inverse(shipped: sm.Machine) -> None:
    s = shipped.solve(poses(shipped, 10, 7), wrenches(10, 8))
    size = np.sqrt(np.diagonal(s.compliance, axis1=-2, axis2=-1))
    product = (s.stiffness @ s.compliance) * size[:, :, None] / size[:, None, :]
    np.testing.assert_allclose(product, np.broadcast_to(np.eye(6), product.shape), atol=1e-9)


@pytest.mark.parametrize("load_type", ["follower", "semitangential"])
def test_other_load_types_meet_the_dead_one_at_small_loads(orthoglide: sm.Machine, load_type: str) -> None:
    at, load = poses(orthoglide, 5, 9), wrenches(5, 10)
    small = [orthoglide.solve(at, 1e-3 * load, load_type=kind).displacement for kind in ("dead", load_type)]
    np.testing.assert_allclose(small[1], small[0], rtol=1e-5, atol=1e-13)
    large = [orthoglide.solve(at, load, load_type=kind).displacement for kind in ("dead", load_type)]
    assert np.abs(large[1] - large[0]).max() > 1e-9


def test_semitangential_moments_are_conservative(orthoglide: sm.Machine) -> None:
    at, load = poses(orthoglide, 5, 11), wrenches(5, 12)
    s = orthoglide.solve(at, load, load_type="semitangential")
    size = np.sqrt(np.diagonal(s.stiffness, axis1=-2, axis2=-1))
    asymmetry = np.abs(s.stiffness - np.swapaxes(s.stiffness, -1, -2)) / (size[:, :, None] * size[:, None, :])
    assert asymmetry.max() < 1e-9
    assert not (s.flags & sm.Flag.NONCONSERVATIVE).any()
    assert (orthoglide.solve(at, load).flags & sm.Flag.NONCONSERVATIVE).all()
