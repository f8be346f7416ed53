"""Answers do not depend on where the machine stands or how it is cut into elements."""

from __future__ import annotations

import numpy as np
import pytest
from tests.python.solve import builders as b
from tests.python.solve.sampling import poses, relative, wrenches

import stiffmap as sm

METHODS = ("fast", "reference")


@pytest.mark.parametrize("method", METHODS)
def test_turning_the_machine_turns_the_answer(shipped: sm.Machine, method: str) -> None:
    r, p = b.rotation((1, -2, 0.5), 2.1), np.array([3.0, -1.0, 0.7])
    moved = b.turned(shipped.description, r, p)
    at, load = poses(shipped, 6, 1), wrenches(6, 2)
    turn = np.kron(np.eye(2), r)
    here = shipped.solve(at, load, method=method)
    there = moved.solve(at @ r.T + p, load @ turn.T, rotation=r @ shipped.description.home.r, method=method)
    np.testing.assert_array_equal(there.status, here.status)
    np.testing.assert_allclose(there.displacement, here.displacement @ turn.T, rtol=1e-7, atol=1e-12)
    assert relative(turn.T @ there.compliance @ turn, here.compliance) < 1e-9
    np.testing.assert_allclose(there.actuator_effort, here.actuator_effort, rtol=1e-7, atol=1e-6)
    np.testing.assert_allclose(there.leg_wrench, here.leg_wrench @ turn.T, rtol=1e-6, atol=1e-5)


def test_wrench_at_another_point_is_the_equivalent_one_at_the_tcp() -> None:
    """A force at a point of the platform is the same force and its moment at the TCP."""
    rng = np.random.default_rng(3)
    from stiffmap.model.description import Leg, MachineDescription, Point

    k, arm = b.random_spd(rng), np.array([0.1, -0.2, 0.3])
    machine = sm.Machine(
        MachineDescription("m", (Leg("one", (b.stiff("link", k),)),), platform=(Point("flange", tuple(arm)),))
    )
    force = np.array([30.0, -20, 10])
    at_point = machine.solve((0, 0, 0), [*force, 0, 0, 0], point="platform.flange", read_points=("tcp",))
    at_tcp = machine.solve((0, 0, 0), [*force, *np.cross(arm, force)], read_points=("platform.flange",))
    # to first order: the arm itself turns under the dead force
    np.testing.assert_allclose(at_point.readings[1], at_tcp.readings[0], rtol=1e-3, atol=1e-9)
    np.testing.assert_allclose(at_point.readings[0], at_tcp.readings[1], rtol=1e-3, atol=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_a_rigid_offset_may_be_cut_in_two(method: str) -> None:
    rng = np.random.default_rng(4)
    k = b.random_spd(rng)
    home = b.Pose.of((0.5, 0.1, -0.2))
    whole = b.serial(b.stiff("link", k), b.shift("tool", (0.5, 0.1, -0.2)), home=home)
    cut = b.serial(
        b.stiff("link", k), b.shift("tool1", (0.2, 0.1, 0.3)), b.shift("tool2", (0.3, 0, -0.5)), home=home
    )
    load = (500.0, -300, 200, 20, 30, -10)
    a, c = (m.solve((0.5, 0.1, -0.2), load, method=method) for m in (whole, cut))
    np.testing.assert_allclose(c.displacement, a.displacement, rtol=1e-10)
    assert relative(c.compliance, a.compliance) < 1e-10


@pytest.mark.parametrize("method", METHODS)
def test_scaling_all_springs_scales_the_answer(orthoglide: sm.Machine, method: str) -> None:
    """Twice the load on a machine twice as stiff: the same displacement, half the compliance."""
    rng = np.random.default_rng(5)
    legs = [[b.random_spd(rng) for _ in range(2)] for _ in range(2)]

    def machine(factor: float) -> sm.Machine:
        return b.parallel(
            *(
                (b.stiff("a", factor * k1), b.shift("s", (0.4, 0, 0)), b.stiff("b", factor * k2))
                for k1, k2 in legs
            ),
            home=b.Pose.of((0.4, 0, 0)),
        )

    load = np.array([5e3, -2e3, 3e3, 200, -100, 300])
    one = machine(1).solve((0.4, 0, 0), load, method=method)
    two = machine(2).solve((0.4, 0, 0), 2 * load, method=method)
    np.testing.assert_allclose(two.displacement, one.displacement, rtol=1e-9)
    assert relative(2 * two.compliance, one.compliance) < 1e-9
