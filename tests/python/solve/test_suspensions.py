"""Platforms on lines, against bodies in Cartesian coordinates: no free ball locks, and nothing that is out of balance is an answer."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.oracle.suspensions import Suspension, cables, struts, turned

import stiffmap as sm

METHODS = ("fast", "reference")
GRAVITY = np.array([0, 0, -9.81])


def agrees(
    s: sm.Solution, plant: Suspension, p: np.ndarray, r: np.ndarray, w: np.ndarray, heavy: bool
) -> None:
    truth = plant.bodies(p, r, w, GRAVITY if heavy else None).least()
    assert truth.force < 1e-7 and truth.lowest > 0
    assert s.status == sm.Status.CONVERGED
    moved = truth.moved(0, p, r)
    np.testing.assert_allclose(s.displacement, moved, rtol=0, atol=1e-9 * np.abs(moved).max())
    scale = np.sqrt(np.abs(np.diag(s.compliance)))
    assert (np.abs(s.compliance - truth.compliance(0)) / np.outer(scale, scale)).max() < 1e-6


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("degrees", [60, 89.9, 90, -90, 90.1, 120])
def test_no_free_ball_locks(degrees: float, method: str) -> None:
    """The first strut's ball turns as the platform does: about its second axis by a right angle."""
    plant, w = struts(3), np.array([300, -200, 100, 4, 5, -3.0])
    for axes in ("xyz", "zyx"):
        r = turned(axes[1], degrees)
        s = sm.Machine(plant.machine(axes)).solve(
            plant.tip, w, rotation=r, load_type="semitangential", method=method
        )
        agrees(s, plant, plant.tip, r, w, heavy=False)
        assert not s.flags & sm.Flag.GIMBAL_LOCK


@pytest.mark.parametrize("method", METHODS)
def test_the_order_of_a_free_balls_axes_changes_no_answer(method: str) -> None:
    plant, w = struts(3), np.array([300, -200, 100, 0, 0, 0.0])
    turns = [turned(a, d) for a in "xyz" for d in (0, 89.999, 90, 91)]
    right = sm.Machine(plant.machine()).solve([plant.tip] * len(turns), w, rotation=turns, method=method)
    assert (right.status == sm.Status.CONVERGED).all()
    for axes in permutations("xyz"):
        s = sm.Machine(plant.machine("".join(axes))).solve(
            [plant.tip] * len(turns), w, rotation=turns, method=method
        )
        for got, wanted in ((s.displacement, right.displacement), (s.compliance, right.compliance)):
            assert np.abs(got - wanted).max() < 1e-9 * np.abs(wanted).max()
        np.testing.assert_array_equal(s.status, right.status)


def load(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A pose within the cables' room and a wrench that may make some of them slack."""
    rng = np.random.default_rng(seed)
    p = np.array([0.02, -0.03, 0.95]) + rng.uniform(-0.15, 0.15, 3)
    r = Rotation.from_rotvec(rng.uniform(-0.2, 0.2, 3)).as_matrix()
    return p, r, np.array([*rng.uniform(-1500, 1500, 3), *rng.uniform(-80, 80, 3)])


def compared(number: int, seed: int, method: str) -> None:
    plant = cables(seed, number)
    p, r, w = load(seed)
    s = sm.Machine(plant.machine()).solve(
        p, w, rotation=r, gravity=GRAVITY, load_type="semitangential", method=method
    )
    agrees(s, plant, p, r, w, heavy=True)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("seed", range(4))
def test_cables_of_which_some_are_slack(seed: int, method: str) -> None:
    compared(8, seed, method)


@pytest.mark.parametrize("number", [6, 8])
def test_many_suspensions(number: int) -> None:
    for seed in range(100, 108):
        for method in METHODS:
            compared(number, seed, method)
