"""More legs or bars than needed, rigid directions, and what they leave open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.python.solve import builders as b
from tests.python.solve.sampling import relative

import stiffmap as sm
from stiffmap.model.description import Block, Element, Pose, Spring

METHODS = ("fast", "reference")
LOAD = np.array([300.0, -200, 100, 20, 10, -30])


@pytest.mark.parametrize("method", METHODS)
def test_an_over_constrained_machine_is_solved(orthoglide: sm.Machine, method: str) -> None:
    """Without its springs the Orthoglide could not even be assembled: its parallelograms over-constrain it."""
    s = orthoglide.solve((0.1, -0.1, 0.2), LOAD, method=method)
    assert int(s.status) == sm.Status.CONVERGED
    assert np.linalg.matrix_rank(s.stiffness * np.outer([1, 1, 1, 1, 1, 1], [1] * 6)) == 6


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("n", [2, 5, 9])
def test_many_equal_legs(method: str, n: int) -> None:
    k = b.random_spd(np.random.default_rng(1))
    s = b.parallel(*[(b.stiff("link", k),)] * n).solve((0, 0, 0), LOAD, method=method)
    np.testing.assert_allclose(s.stiffness[:3, :3], n * k[:3, :3], rtol=1e-3)
    np.testing.assert_allclose(s.leg_wrench, np.broadcast_to(-LOAD / n, (n, 6)), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_blocks_inside_blocks(method: str) -> None:
    rng = np.random.default_rng(2)
    k = [b.random_spd(rng) for _ in range(4)]
    inner = b.block("inner", (b.stiff("s", k[0]),), (b.stiff("s", k[1]),))
    machine = b.serial(b.block("outer", (inner, b.stiff("s", k[2])), (b.stiff("s", k[3]),)))
    series = np.linalg.inv(np.linalg.inv(k[0] + k[1]) + np.linalg.inv(k[2]))
    got = machine.solve((0, 0, 0), method=method)
    np.testing.assert_allclose(got.stiffness, series + k[3], rtol=1e-9, atol=1e-3)


@pytest.mark.parametrize("method", METHODS)
def test_rank_deficient_compliance_is_the_limit_of_stiff_ones(method: str) -> None:
    """A link that bends but does not stretch or twist, its null directions not along the axes."""
    r = b.rotation((1, 2, 3), 0.7)
    turn = np.kron(np.eye(2), r)
    soft = turn @ np.diag([0, 2e-6, 1e-6, 0, 3e-5, 2e-5]) @ turn.T
    tip = (0.4, 0.1, -0.2)

    def machine(c: np.ndarray) -> sm.Machine:
        return b.serial(
            b.soft("base", 1e-6 * np.eye(6)), b.soft("link", c), b.shift("tip", tip), home=Pose.of(tip)
        )

    rigid = machine(soft).solve(tip, LOAD, method=method)
    nearly = [machine(soft + e * np.eye(6)).solve(tip, LOAD, method=method) for e in (1e-9, 1e-10)]
    gaps = [relative(s.compliance, rigid.compliance) for s in nearly]
    assert gaps[0] == pytest.approx(10 * gaps[1], rel=0.05) and gaps[1] < 1e-3
    assert int(rigid.status) == sm.Status.CONVERGED


@pytest.mark.parametrize("method", METHODS)
def test_rigid_direction_has_compliance_only(method: str) -> None:
    c = np.diag([1e-6, 0, 2e-6, 0, 1e-5, 3e-5])
    s = b.serial(b.soft("link", c)).solve((0, 0, 0), LOAD, method=method)
    assert int(s.status) == sm.Status.CONVERGED
    assert int(s.flags) & sm.Flag.RIGID_DIRECTION
    assert np.isnan(s.stiffness).all()
    assert s.displacement[1] == 0 and s.displacement[0] == pytest.approx(3e-4, rel=1e-9)
    assert np.abs(s.compliance[1]).max() == 0


@pytest.mark.parametrize("method", METHODS)
def test_rigid_loops_leave_their_wrenches_open(method: str) -> None:
    """Two rigid legs behind one spring: who carries what is not a number."""
    k = b.random_spd(np.random.default_rng(3))
    from stiffmap.model.description import Leg, MachineDescription

    machine = sm.Machine(
        MachineDescription(
            "rigid",
            (Leg("a", (b.shift("s", (1, 0, 0)),)), Leg("b", (b.shift("s", (1, 0, 0)),))),
            platform=(b.stiff("tool", k),),
            home=Pose.of((1, 0, 0)),
        )
    )
    s = machine.solve((1, 0, 0), LOAD, method=method)
    assert int(s.status) == sm.Status.CONVERGED
    assert int(s.flags) & sm.Flag.INTERNAL_WRENCH_UNDETERMINED
    assert np.isnan(s.leg_wrench).all()
    np.testing.assert_allclose(s.stiffness[:3, :3], k[:3, :3], rtol=1e-3)


@pytest.mark.parametrize("method", METHODS)
def test_a_locked_machine_with_rigid_drives(method: str) -> None:
    """Drives without compliance do not move; the links alone deflect."""
    k = b.random_spd(np.random.default_rng(4))
    s = b.serial(b.slider("drive", home=0.2), b.stiff("link", k), home=Pose.of((0.2, 0, 0))).solve(
        (0.2, 0, 0), LOAD, method=method
    )
    assert s.joint_coordinates["arm.drive"] == pytest.approx(0.2, abs=1e-15)
    assert s.actuator_effort[0] == pytest.approx(-LOAD[0], rel=1e-9)


def without_springs(elements: tuple[Element, ...], names: tuple[str, ...]) -> tuple[Element, ...]:
    """The same chain with these springs taken out: what they stood for is rigid."""
    kept: list[Element] = []
    for e in elements:
        if isinstance(e, Block):
            branches = [replace(x, elements=without_springs(x.elements, names)) for x in e.branches]
            kept.append(replace(e, branches=tuple(branches)))
        elif not (isinstance(e, Spring) and e.name in names):
            kept.append(e)
    return tuple(kept)


@pytest.mark.parametrize("method", METHODS)
def test_a_delta_whose_drives_alone_yield_cannot_turn(method: str) -> None:
    """Gosselin's model: C = (sum of J J^T k)^-1 with q = z + sqrt(l² - h²), and no rotation at all. Its parallelograms are
    overconstrained, so that the platform's impossible turns spread over their loops."""
    d = sm.load_machine("linear-delta").description
    legs = tuple(replace(x, elements=without_springs(x.elements, ("guide", "rod"))) for x in d.legs)
    machine = sm.Machine(replace(d, legs=legs))
    rng = np.random.default_rng(4)
    towers = 0.3 * np.array([[np.cos(a), np.sin(a)] for a in np.radians([210, -30, 90])])
    for p in rng.uniform((-0.1, -0.1, 0.2), (0.1, 0.1, 0.4), (8, 3)):
        s = machine.solve(p, method=method)
        away = p[:2] - towers
        down = np.sqrt(0.25 - (away**2).sum(axis=1))
        j = np.column_stack([-away / down[:, None], np.ones(3)])
        np.testing.assert_allclose(s.compliance[:3, :3], np.linalg.inv(j.T @ j / 4e-7), rtol=1e-9, atol=1e-16)
        assert np.abs(s.compliance[3:]).max() < 1e-15
        assert s.flags & sm.Flag.RIGID_DIRECTION
        assert np.isnan(s.stiffness).all()
        assert s.status == sm.Status.CONVERGED
