"""Poses whose load needs proven steps: same statuses, same unstable equilibria, same bits in any company."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.oracle.classes import Classes
from tests.oracle.unseen import leaf_spring
from tests.python.solve.compiled.agreement import TOLERANCE, displacement_gap

import stiffmap as sm

FORCE = np.array([900.0, 450.0, -1800.0, 0.0, 0.0, 0.0])
MOMENT = np.array([400.0, -250.0, -950.0, 25.0, -20.0, 30.0])


def poses(machine: sm.Machine, n: int) -> np.ndarray:
    """Positions (n, 3) m in the workspace box and around it, up to 1.6 times its size."""
    low, high = machine.workspace
    return (low + high) / 2 + 0.8 * (high - low) * np.random.default_rng(41).uniform(-1, 1, (n, 3))


@pytest.mark.parametrize("wrench", [FORCE, MOMENT], ids=["force", "moment"])
def test_rods_that_buckle(wrench: np.ndarray) -> None:
    machine = sm.load_machine("linear-delta")
    position = poses(machine, 150)
    fast = machine.solve(position, wrench)
    stepped = np.flatnonzero(fast.flags & sm.Flag.LOAD_STEPPED)[:12]
    assert len(stepped) >= 5
    reference = machine.solve(position[stepped], wrench, method="reference")
    np.testing.assert_array_equal(fast.status[stepped], reference.status)
    same = np.isfinite(reference.displacement).all(axis=1)
    gap = displacement_gap(fast.displacement[stepped][same], reference.displacement[same])
    assert gap < TOLERANCE
    if wrench is FORCE:
        assert (reference.status == sm.Status.UNSTABLE).sum() >= 3
        assert fast.reference_share < 0.02


@pytest.mark.parametrize("name", ["orthoglide-original", "orthoglide-revised"])
def test_beyond_the_end_of_the_path_both_paths_wander_alike(name: str) -> None:
    machine = sm.load_machine(name)
    position = poses(machine, 9000)
    wrench = np.zeros((len(position), 6))
    wrench[:, :3] = 400.0 * np.random.default_rng(43).normal(size=(len(position), 3))
    fast = machine.solve(position, wrench)
    beyond = np.flatnonzero(fast.flags & sm.Flag.BRANCH_UNVERIFIED)[:12]
    assert len(beyond) == 12
    assert fast.reference_share < 0.02  # of poses beyond a change of stability that the kernels doubt
    reference = machine.solve(position[beyond], wrench[beyond], method="reference")
    np.testing.assert_array_equal(fast.status[beyond], reference.status)
    np.testing.assert_array_equal(fast.flags[beyond] & ~np.uint32(sm.Flag.REFERENCE_PATH), reference.flags)
    assert (reference.status == sm.Status.NOT_CONVERGED).any()
    found = np.isfinite(reference.displacement).all(axis=1)
    np.testing.assert_array_equal(np.isfinite(fast.displacement[beyond]).all(axis=1), found)
    assert found.any()
    assert displacement_gap(fast.displacement[beyond][found], reference.displacement[found]) < TOLERANCE


def test_the_same_bits_in_any_company() -> None:
    machine = sm.load_machine("linear-delta")
    position = poses(machine, 120)
    whole = machine.solve(position, FORCE)
    order = np.random.default_rng(42).permutation(len(position))
    mixed = machine.solve(position[order], FORCE, threads=1)
    np.testing.assert_array_equal(mixed.displacement, whole.displacement[order])
    np.testing.assert_array_equal(mixed.compliance, whole.compliance[order])
    np.testing.assert_array_equal(mixed.flags, whole.flags[order])
    stepped = np.flatnonzero(whole.flags & sm.Flag.LOAD_STEPPED)[:3]
    for i in stepped:
        alone = machine.solve(position[i : i + 1], FORCE)
        np.testing.assert_array_equal(alone.displacement[0], whole.displacement[i])
        assert alone.iterations[0] == whole.iterations[i]


def test_a_gap_is_no_way_to_another_assembly() -> None:
    """Newton's leap across the corner of a law landed 160 mm off, balanced and unflagged (theory E9)."""
    machine = sm.load_machine("3-rps").with_effect("dead_zone", element="strut", legs=["a"], half_width=1e-6)
    force = np.array([200.0, 400.0, 800.0])
    s = machine.solve(np.tile([0, 0, 0.6275], (3, 1)), force[:, None] * np.eye(6)[1])
    assert (s.status == 0).all()
    assert s.displacement[:, 1] == pytest.approx(4.3773e-7 * force, rel=1e-3)


def test_a_leaf_spring_bent_by_radians_takes_few_steps() -> None:
    """Steps along the path foresee its bend (F22): halves alone take 110 linearisations on average."""
    machine = sm.Machine(leaf_spring())
    force = np.random.default_rng(1).normal(size=(48, 3))
    wrench = np.hstack([230.0 * force / np.linalg.norm(force, axis=1)[:, None], np.zeros((48, 3))])
    fast = machine.solve(machine.description.home.p, wrench)
    assert (fast.flags == sm.Flag.LOAD_STEPPED).all()
    assert np.abs(fast.displacement[:, 3:]).max() > 2
    assert fast.iterations.mean() < 55
    assert fast.iterations.max() < 110
    reference = machine.solve(machine.description.home.p, wrench[:12], method="reference")
    np.testing.assert_array_equal(reference.status, sm.Status.CONVERGED)
    assert displacement_gap(fast.displacement[:12], reference.displacement) < TOLERANCE


def test_the_steps_of_a_path_do_not_depend_on_its_neighbours() -> None:
    machine = sm.Machine(leaf_spring())
    wrench = np.zeros((24, 6))
    wrench[:, :3] = np.random.default_rng(7).normal(size=(24, 3)) * np.geomspace(1, 3000, 24)[:, None]
    whole = machine.solve(machine.description.home.p, wrench, threads=1)
    for i in (0, 9, 17, 23):
        alone = machine.solve(machine.description.home.p, wrench[i : i + 1], threads=1)
        np.testing.assert_array_equal(alone.displacement[0], whole.displacement[i])
        np.testing.assert_array_equal(alone.iterations[0], whole.iterations[i])


@pytest.mark.parametrize(("seed", "half"), [(27, 0.1), (53, 0.0)])
def test_a_preload_that_is_far_from_the_command_needs_no_path_without_a_load(seed: int, half: float) -> None:
    """Rests of springs, or springs outside the legs, move these machines by a tenth of their length: with nothing else to
    bear, the first equilibrium is the answer, of which there is no doubt."""
    description = Classes(seed).task().description
    low, high = (tuple((description.home.p + side * half).tolist()) for side in (-1, 1))
    machine = sm.Machine(replace(description, workspace=(low, high)))
    position = np.random.default_rng(1).uniform(low, high, (40, 3))
    fast, reference = (machine.solve(position, method=way) for way in ("fast", "reference"))
    assert (fast.status == reference.status).all()
    ok = fast.ok
    assert (fast.flags[ok] & sm.Flag.LOAD_STEPPED).any()
    for answer in (fast, reference):
        assert not (answer.flags[ok] & sm.Flag.BRANCH_UNVERIFIED).any()
    assert not (fast.flags[ok] & sm.Flag.REFERENCE_PATH).any()
    np.testing.assert_allclose(fast.displacement[ok], reference.displacement[ok], rtol=0, atol=1e-12)
