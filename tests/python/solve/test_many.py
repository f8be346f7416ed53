"""Answers are equilibria of free bodies (`python -m tests.oracle.many` for many more)."""

from __future__ import annotations

import numpy as np
import pytest
from tests.oracle.crowd import KINDS
from tests.oracle.many import RANDOM, Batch, asked, changed, question_at, run
from tests.oracle.statics import Case, balance, closed, coordinates
from tests.oracle.verify import verified

import stiffmap as sm


@pytest.mark.parametrize("machine", sm.machine_names())
def test_answers_are_equilibria(machine: str) -> None:
    found = run(Batch(machine, "as declared", 7), count=40)
    assert found["wrong"] == {}
    assert found["status"]["CONVERGED"] >= 10  # type: ignore[index]


@pytest.mark.parametrize(
    ("machine", "effect"),
    [
        ("orthoglide-revised", e)
        for e in ("dead_zone", "friction", "hardening", "straightness", "joint_friction")
    ]
    + [
        ("linear-delta", "friction"),
        ("hexapod", "joint_friction"),
        ("tripteron", "dead_zone"),
        ("ur10", "friction"),
    ],
)
def test_answers_with_an_effect_at_every_place_are_equilibria(machine: str, effect: str) -> None:
    found = run(Batch(machine, effect, 3), count=40)
    assert found["wrong"] == {}
    assert found["status"]["CONVERGED"] >= 30  # type: ignore[index]
    assert found["undecided"] <= 2  # type: ignore[operator]


@pytest.mark.parametrize("kind", KINDS)
def test_answers_of_random_machines_are_equilibria(kind: str) -> None:
    found = run(Batch(kind, RANDOM, 4), count=20)
    assert found["wrong"] == {}
    assert found["status"]["CONVERGED"] >= 10  # type: ignore[index]


def test_a_gap_may_bear_little() -> None:
    # 1e-5 N beside 14 N is no round-off: the gap is closed, 20 um from its middle (theory L1)
    for seed, at in ((1, 27), (3, 66)):
        machine, _ = changed("tripteron", "dead_zone")
        assert machine is not None
        p, load = asked(machine, np.random.default_rng([seed, *b"tripteron", *b"dead_zone"]), 100)
        one = {**load, "wrench": load["wrench"][at : at + 1]}  # type: ignore[index]
        s = machine.solve(p[at : at + 1], **one)  # type: ignore[arg-type]
        verdict = verified(question_at(machine, p[at : at + 1], one), s, np.array([0]))
        assert s.ok.all() and not verdict.bad


def test_a_load_that_is_taken_in_steps_across_gaps_says_so() -> None:
    machine, _ = changed("tripteron", "dead_zone")
    assert machine is not None
    p, load = asked(machine, np.random.default_rng([3, *b"tripteron", *b"dead_zone"]), 60)
    flags = machine.solve(p, **load).flags  # type: ignore[arg-type]
    assert np.sum((flags & sm.Flag.LOAD_STEPPED) > 0) > 10


def test_what_round_off_alone_would_do_proves_nothing() -> None:
    # the ram of the travelling column drawn in to nothing: 3e18 N/m, and a preload of 10 um beside a deflection of 1e-16 m
    found = run(Batch("travelling-column", "preload", 11))
    assert found["wrong"] == {} and found["undecided"] == 1
    assert run(Batch("hybrid", "joint_compliance", 10))["wrong"] == {}


def test_what_bears_only_in_second_order_does_not_rub() -> None:
    # The guides of a delta bear no moment about y in linear statics: friction there has no side (theory L3).
    machine = sm.load_machine("linear-delta")
    rubbing = machine.with_effect(
        "friction", element="guide.k55", legs=list(machine.legs), torque=2.0, branch="loading"
    )
    p, force = [0.02, -0.03, 0.3], [8.0, 5.0, -12.0, 0, 0, 0]
    for method in ("fast", "reference"):
        with_it, without = (m.solve(p, force, method=method) for m in (rubbing, machine))
        assert with_it.displacement == pytest.approx(without.displacement, abs=1e-12)


def test_a_wrong_coordinate_is_noticed_by_its_size() -> None:
    machine = sm.load_machine("ur10")
    home = np.array(machine.description.home.p)
    s = machine.solve(home, [0.0, 50.0, -100.0, 0, 0, 0])
    start = sm.inverse_kinematics(machine, home[None])
    force = np.array([[0.0, 50.0, -100.0]])
    command = {n: start.actuators[:, i] for i, n in enumerate(s.actuators)}
    case = Case(command, np.eye(3)[None], force, 0 * force, np.zeros(3))
    tip = closed(machine.description, coordinates(s.coordinate_names, start.coordinates), case, 1.0)[1]
    assert tip.p[0] == pytest.approx(home, abs=1e-12)
    x = coordinates(s.coordinate_names, s.coordinates[None])
    sound = balance(machine.description, x, case, 1.0)
    assert sound.residual[0] < 1e-8 * sound.scale[0]
    x["arm.elbow"] = x["arm.elbow"] + 1e-6
    spoilt = balance(machine.description, x, case, 1.0)
    law = next(e.law for e in machine.description.legs[0].elements if e.name == "elbow")
    assert spoilt.residual[0] == pytest.approx(1e-6 * law.stiffness, rel=1e-2)


def test_a_wrong_force_in_a_loop_is_noticed_by_its_size() -> None:
    # the wrenches of the loops take a wrong force of one leg over, but not that of a drive with a rigid leg behind it
    machine = sm.load_machine("orthoglide-revised")
    p = np.array([[0.05, -0.1, 0.12]])
    load = {"wrench": np.array([[100.0, -50.0, 80.0, 0, 0, 0]]), "gravity": [0.0] * 3, "load_type": "dead"}
    q = question_at(machine, p, load)
    s = q.solve()
    command = {n: q.before[n] for n in s.actuators}
    case = Case(
        command, np.eye(3)[None], load["wrench"][:, :3], np.zeros((1, 3)), np.zeros(3), "dead", q.before
    )  # type: ignore[index, arg-type]
    x = coordinates(s.coordinate_names, s.coordinates)
    sound = balance(machine.description, x, case, q.size)
    assert sound.residual[0] < 1e-9 * sound.scale[0]
    x["x.foot.tx"] = x["x.foot.tx"] + 1e-6
    x["x.actuator"] = x["x.actuator"] - 1e-6  # along the same line: everything behind them stays
    spoilt = balance(machine.description, x, case, q.size)
    assert spoilt.gap[0] < 1e-9
    stiffness = 1 / 1.4e-7  # of the drive, N/m
    assert 0.1 * 1e-6 * stiffness < spoilt.residual[0] < 10 * 1e-6 * stiffness
