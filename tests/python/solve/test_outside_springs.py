"""A platform on a leaf, pulled by springs that stand outside the legs, some of which go slack: against bodies in Cartesian coordinates.
Such springs pull without a load, so that already the unloaded machine stands off its command."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.oracle.complex_steps import At, Bodies, Force, Leaf, Line, Part
from tests.oracle.suspensions import UNITS, turned
from tests.python.solve.test_leaves import leaf

import stiffmap as sm
from stiffmap.model.description import (
    ExternalSpring,
    Joint,
    Leg,
    MachineDescription,
    Offset,
    Point,
    Pose,
    Spring,
)

TIP = np.array([0, 0, 0.5])
UP = turned("y", -90)


def pull(stiffness: float, free: float, tension_only: bool) -> Callable[[complex], complex]:
    def energy(length: complex) -> complex:
        d = length - free
        return 0j if tension_only and d.real < 0 else stiffness * d * d / 2

    return energy


def rows(k: np.ndarray) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(float(v) for v in row) for row in k)


def machine(seed: int, tension_only: bool, idle: bool = False) -> tuple[MachineDescription, list[Part]]:
    """`idle`: and a leg whose joints are all free."""
    rng = np.random.default_rng(seed)
    k = leaf(0.02, 0.002)
    elements = (
        Offset("foot", Pose.of([0, 0, 0.4], UP)),
        Offset("length", Pose.of([0.1, 0, 0])),
        Spring("leaf", stiffness=rows(k)),
        Offset("plate", Pose.of([0, 0, 0], UP.T)),
    )
    legs = [Leg("leaf", elements)]
    points: list[Point] = []
    springs: list[ExternalSpring] = []
    parts: list[Part] = [Leaf(At(None, TIP, UP), At(0, np.zeros(3), UP), k)]
    for i in range(int(rng.integers(2, 5))):
        at, anchor = rng.uniform(-0.2, 0.2, 3), TIP + rng.uniform(-0.6, 0.6, 3)
        length = float(np.linalg.norm(anchor - TIP - at))
        free, stiffness = length * float(rng.uniform(0.999, 1.0005)), float(10 ** rng.uniform(3, 8))
        points.append(Point(f"p{i}", (float(at[0]), float(at[1]), float(at[2]))))
        springs.append(
            ExternalSpring(f"s{i}", f"platform.p{i}", tuple(anchor), stiffness, free, tension_only)
        )
        parts.append(Line(At(None, anchor), At(0, at), pull(stiffness, free, tension_only)))
    if idle:
        legs.append(
            Leg(
                "idle",
                (
                    Offset("foot", Pose.of([0.3, 0.1, 0])),
                    Joint("eye", "universal", (UNITS["x"], UNITS["y"]), (0.0, 0.0)),
                    Joint("slide", "prismatic", (UNITS["z"],), (0.5,)),
                    Spring("rod", stiffness=rows(100 * k)),
                    Joint("ball", "spherical", (UNITS["x"], UNITS["y"], UNITS["z"]), (0.0, 0.0, 0.0)),
                    Offset("plate", Pose.of([-0.3, -0.1, 0.0])),
                ),
            )
        )
    d = MachineDescription(
        "hung",
        tuple(legs),
        platform=tuple(points),
        external_springs=tuple(springs),
        home=Pose.of(TIP),
    )
    return d, parts


CASES = [(1, False), (9, False), (12, False), (0, True), (13, True), (19, True), (26, True)]


@pytest.mark.parametrize(("seed", "tension_only"), CASES)
def test_springs_outside_the_legs(seed: int, tension_only: bool) -> None:
    """In balance, at a minimum, by both paths."""
    d, parts = machine(seed, tension_only, idle=seed % 2 == 1)
    force = np.random.default_rng(seed).normal(size=3) * 30
    plant = Bodies([(TIP, np.eye(3))], [*parts, Force(At(0, np.zeros(3)), force)])
    for method in ("fast", "reference"):
        s = sm.Machine(d).solve(TIP, [*force, 0, 0, 0], method=method)
        assert s.status == sm.Status.CONVERGED
        moved = Rotation.from_rotvec(s.displacement[3:]).as_matrix()
        there = [(TIP + s.displacement[:3], moved)]
        assert np.abs(plant.slope(there)).max() < 1e-5
        least, rng = plant.energy(there).real, np.random.default_rng(0)
        for step in rng.normal(size=(200, 6)) * 3e-5:  # across corners the energy has no Hessian
            assert plant.energy(plant.stepped(there, step)).real > least
        if seed % 2:
            np.testing.assert_allclose(s.leg_wrench[..., 1, :], 0, atol=1e-5)
