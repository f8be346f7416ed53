"""How much a diagnosis tries, and what it keeps for later."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.kept import Kept
from stiffmap.experiment import Experiment, Predictor, random_plan, simulate
from stiffmap.experiment.noise.level import noise_of
from stiffmap.experiment.noise.whitening import Problem
from stiffmap.experiment.poses.configuration import coordinates_of, in_reach
from stiffmap.experiment.prediction.predict import DEAR, FAILURE, Effort
from stiffmap.identification.diagnosis import clock
from stiffmap.identification.diagnosis.candidates.candidates import Candidate
from stiffmap.identification.diagnosis.clock import Clock
from stiffmap.identification.diagnosis.fitting.fit import fit
from stiffmap.identification.diagnosis.fitting.model import Model
from stiffmap.identification.diagnosis.report.sentences import opening
from stiffmap.model.description.rigid import nominal_geometry, straight
from stiffmap.model.effects import get


def two_causes(machine: sm.Machine) -> Experiment:
    """Deflections of a machine with two soft drives."""
    plan = random_plan(machine, "deflection", poses=6, loads=6, repeats=2, seed=1)
    soft = machine.with_effect("compliance", element="actuator", legs=["x"], scale=2.0)
    soft = soft.with_effect("compliance", element="actuator", legs=["y"], scale=1.6)
    return simulate(machine, plan, soft.description.effects, seed=2)


def test_the_bound_counts_predictions_and_says_what_it_left_out() -> None:
    machine = sm.load_machine("orthoglide-revised")
    before, clock.MOST = clock.MOST, 5.0
    try:
        first = sm.diagnose(machine, two_causes(machine), seed=0)
        again = sm.diagnose(machine, two_causes(machine), seed=0)
    finally:
        clock.MOST = before
    assert first.stopped and first.not_tried
    assert "not tried: " in first.lines()[-1]
    assert first.as_plain()["not_tried"] == again.as_plain()["not_tried"]


def test_a_search_has_a_share_of_the_bound() -> None:
    made = [0.0]
    c = Clock()
    assert not c.tired
    c.count(lambda: made[0], clock.ROWS)
    c.begin_search()
    made[0] = clock.SHARE * clock.MOST + 1.0
    assert c.tired and not c.spent
    c.begin_search()
    assert not c.tired
    made[0] = clock.MOST + 1.0
    assert c.tired and c.spent


def test_more_rows_allow_fewer_predictions() -> None:
    c = Clock()
    c.count(lambda: 10.0, 4 * clock.ROWS)
    assert c.most == 10 + clock.MOST / 2


def begun_spring(patience: float) -> tuple[Model, Predictor]:
    """Where a fit of a spring at the tool begins, and a predictor with so much patience."""
    machine = sm.load_machine("orthoglide-revised")
    plan = random_plan(machine, "position", poses=6, repeats=2, seed=1)
    predictor = Predictor(machine, simulate(machine, plan, [], seed=2))
    effect = get("external_spring")
    spring = Candidate("external_spring", "tcp", (), effect.parameters)
    predictor.patience = patience
    start = np.array([2e3, 0.5, 0.3, 0.2, 0.1]) / [p.scale for p in effect.parameters]
    return Model((spring,), start), predictor


def test_a_fit_is_given_up_when_its_share_is_spent() -> None:
    for patience, given_up in ((2.0, True), (float("inf"), False)):
        model, predictor = begun_spring(patience)
        e = predictor.experiment
        problem = Problem.of(e, noise_of(e).sigma, predictor())
        before = predictor.effort
        found = fit(model, predictor, problem)
        assert found.given_up is given_up
        assert found.usable is not given_up
        if given_up:
            assert predictor.effort <= before + patience + 1.0
            assert "given up" in found.failure


def test_what_is_too_dear_is_told_and_not_tried_again() -> None:
    machine = sm.load_machine("orthoglide-revised")
    plan = random_plan(machine, "position", poses=8, repeats=2, seed=1)
    pulled = machine.with_effect(
        "external_spring",
        element="tcp",
        stiffness=500.0,
        length=0.3,
        anchor_x=0.5,
        anchor_y=0.2,
        anchor_z=0.3,
    )
    data = simulate(machine, plan, pulled.description.effects, seed=2)
    before, clock.PATIENCE = clock.PATIENCE, 1.0
    try:
        d = sm.diagnose(machine, data, seed=0, cross_validate=False)
    finally:
        clock.PATIENCE = before
    assert d.stopped
    fits = [what for what in d.not_tried if what.startswith("the fit of ")]
    assert fits and len(set(fits)) == len(fits)
    assert not d.effects


def test_predictions_that_leave_the_kernels_count_more() -> None:
    effort = Effort()
    motion = np.zeros((4, 6))
    effort.add(motion, 0.25, declared=True)
    assert (effort.total, effort.own_share) == (1.0, 0.25)
    effort.add(motion, 0.25, declared=False)
    assert effort.total == 2.0  # no dearer than the declared machine
    effort.add(motion, 1.0, declared=False)
    assert effort.total == 3.0 + 0.75 * DEAR
    motion[0] = np.nan
    effort.add(motion, 0.0, declared=False)
    assert effort.total == 4.0 + 0.75 * DEAR + 0.25 * FAILURE


def test_poses_out_of_reach_are_the_closures() -> None:
    """Reach is asked of the kernels first: the same answer as the closures' own."""
    machine = sm.load_machine("linear-delta")
    plan = random_plan(machine, "position", poses=12, seed=1)
    far = plan.position + np.where(np.arange(len(plan)) % 3 == 0, 5.0, 0.0)[:, None]
    plan = replace(plan, position=far)
    expected = np.isfinite(coordinates_of(machine, plan)).all(axis=1)
    assert np.array_equal(in_reach(machine, plan), expected)
    assert expected.any() and not expected.all()


def test_what_was_asked_for_longest_ago_goes_first() -> None:
    kept: Kept[str, int] = Kept(most=10)
    kept.put("a", 1, 4)
    kept.put("b", 2, 4)
    assert kept.get("a") == 1
    kept.put("c", 3, 4)
    assert (kept.get("a"), kept.get("b"), kept.get("c")) == (1, None, 3)
    kept.put("c", 4, 6)
    assert (len(kept), kept.bytes) == (2, 10)


def test_reach_is_asked_once_for_all_machines_of_one_geometry() -> None:
    """Springs, gaps and masses close no joint elsewhere; another length of the bars does."""
    machine = sm.load_machine("linear-delta")
    plan = random_plan(machine, "position", poses=4, seed=1)
    play = machine.with_effect("dead_zone", element="carriage", legs=["a"], half_width=1e-4)
    soft = machine.with_effect("compliance", element="carriage", legs=["a"], scale=2.0)
    same = {nominal_geometry(m.description) for m in (machine, play, soft)}
    assert len(same) == 1
    assert nominal_geometry(sm.load_machine("rotary-delta").description) not in same
    assert straight(machine.description) is machine.description
    assert straight(play.description) == straight(machine.description)
    assert in_reach(play, plan).all()
    assert in_reach(play, plan) is in_reach(machine, plan)
    assert not in_reach(play, plan).flags.writeable
    assert in_reach(sm.load_machine("rotary-delta"), plan) is not in_reach(machine, plan)


@pytest.fixture
def interruptible() -> Iterator[None]:
    """A job in the background ignores Ctrl-C from its start."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize("when", ["a first effect", "structure in what is left", "held-out fold 2 of 5"])
def test_ctrl_c_at_any_step_gives_the_best_so_far(when: str) -> None:
    machine = sm.load_machine("orthoglide-revised")
    said: list[str] = []

    def say(what: str) -> None:
        said.append(what)
        if what == when:
            signal.raise_signal(signal.SIGINT)

    d = sm.diagnose(machine, two_causes(machine), progress=say)
    assert d.stopped
    assert any(what.startswith("nothing more") for what in said)
    assert d.effects or when != "structure in what is left"
    assert d.held_out is None
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize("quantity", ["deflection", "position"])
@pytest.mark.parametrize("when", ["sensitivities of all candidates", "sensitivities: tilt"])
def test_ctrl_c_among_the_sensitivities_says_which_are_missing(quantity: str, when: str) -> None:
    machine = sm.load_machine("orthoglide-revised")
    plan = random_plan(machine, quantity, poses=6, loads=4, repeats=2, seed=len(when))
    off = machine.with_effect("compliance", element="actuator", legs=["x"], scale=2.0)
    off = off.with_effect("zero_offset", element="actuator", legs=["x"], error=1e-4)
    data = simulate(machine, plan, off.description.effects, seed=2)
    said: list[str] = []

    def say(what: str) -> None:
        said.append(what)
        if what == when:
            signal.raise_signal(signal.SIGINT)

    d = sm.diagnose(machine, data, progress=say)
    assert d.stopped and not d.effects and d.verdict == "unattributed"
    missing = [what for what in d.not_tried if what.endswith("no sensitivities")]
    assert "tcp_offset at any place: no sensitivities" in missing
    assert any(what.startswith("compliance at any place") for what in missing) is (
        when != "sensitivities: tilt"
    )
    assert "not tried: " in d.lines()[-1]
    assert "nothing that was tried" in opening(d)
    assert d.to_json() and d.before.size[0] > 0
    whole = sm.diagnose(machine, data, cross_validate=False)  # nothing of it was kept
    assert whole.effects and not whole.stopped


@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_twice_gives_none() -> None:
    def say(what: str) -> None:
        if what in ("a first effect", "structure in what is left"):
            signal.raise_signal(signal.SIGINT)

    machine = sm.load_machine("orthoglide-revised")
    with pytest.raises(KeyboardInterrupt):
        sm.diagnose(machine, two_causes(machine), progress=say)
