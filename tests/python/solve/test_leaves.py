"""Stages without joints, a platform on leaf springs that bend far: the way of the load, against bodies in Cartesian coordinates."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.oracle.complex_steps import At, Bodies, Force, Found, Leaf, Part

import stiffmap as sm
from stiffmap.model.description import Leg, MachineDescription, Offset, Pose, Spring

TIP = np.array([0, 0, 0.1])
LENGTH = 0.1


def leaf(width: float, height: float) -> np.ndarray:
    """(6, 6) stiffness of a leaf of aluminium along x."""
    e, g, area = 70e9, 26e9, width * height
    iz, iy, j = width * height**3 / 12, height * width**3 / 12, width * height**3 / 3
    c = np.diag(
        [LENGTH / (e * area), LENGTH**3 / (3 * e * iz), LENGTH**3 / (3 * e * iy), LENGTH / (g * j), 0, 0]
    )
    c[4, 4], c[5, 5] = LENGTH / (e * iy), LENGTH / (e * iz)
    c[1, 5] = c[5, 1] = LENGTH**2 / (2 * e * iz)
    c[2, 4] = c[4, 2] = -(LENGTH**2) / (2 * e * iy)
    return np.asarray(np.linalg.inv(c))


def stage(legs: int, seed: int) -> tuple[MachineDescription, list[Part]]:
    """A platform on leaves that stand up from the base."""
    rng = np.random.default_rng(seed)
    made: list[Leg] = []
    parts: list[Part] = []
    for i in range(legs):
        turn = 2 * np.pi * i / legs + rng.uniform(-0.1, 0.1)
        r = Rotation.from_euler("ZY", [turn, rng.uniform(-0.2, 0.2) - np.pi / 2]).as_matrix()
        foot = np.array([0.06 * np.cos(turn), 0.06 * np.sin(turn), 0])
        k, end = leaf(0.01, rng.uniform(0.2e-3, 0.5e-3)), foot + LENGTH * r[:, 0]
        elements = (
            Offset("foot", Pose.of(foot, r)),
            Offset("length", Pose.of([LENGTH, 0, 0])),
            Spring("leaf", stiffness=tuple(tuple(float(v) for v in row) for row in k)),
            Offset("plate", Pose.of(r.T @ (TIP - end), r.T)),
        )
        made.append(Leg(f"leaf{i + 1}", elements))
        parts.append(Leaf(At(None, end, r), At(0, end - TIP, r), k))
    return MachineDescription("stage", tuple(made), home=Pose.of(TIP)), parts


def followed(parts: list[Part], force: np.ndarray, steps: int) -> Found:
    """The stable equilibrium at the end of the way from the unloaded stage."""
    bodies = [(TIP, np.eye(3))]
    for k in range(1, steps + 1):
        plant = Bodies(bodies, [*parts, Force(At(0, np.zeros(3)), force * k / steps)])
        found = plant.least(bodies, 30)
        assert found.lowest > 0
        bodies = found.bodies
    return found


FAR = {  # seed of a stage on two leaves: force, N
    40: (65.2, -28.234, -21.506),
    180: (-0.126, 10.475, 0.784),
    253: (-62.792, -8.609, 4.526),
}


@pytest.mark.parametrize("seed", list(FAR))
def test_the_reference_follows_leaves_that_bend_far(seed: int) -> None:
    (d, parts), force = stage(2, seed), FAR[seed]
    moved = followed(parts, np.array(force), 12).moved(0, TIP, np.eye(3))
    for method in ("fast", "reference"):
        s = sm.Machine(d).solve(TIP, [*force, 0, 0, 0], method=method)
        assert s.status == sm.Status.CONVERGED and not s.flags & sm.Flag.BRANCH_UNVERIFIED
        np.testing.assert_allclose(s.displacement, moved, rtol=0, atol=1e-7 * np.abs(moved).max())
