"""How much a diagnosis tries, and what it keeps for later."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.kept import Kept
from stiffmap.experiment import Experiment, random_plan, simulate
from stiffmap.experiment.poses.configuration import coordinates_of, in_reach
from stiffmap.identification.diagnosis.report.sentences import opening
from stiffmap.model.description.alike import nominal_geometry, straight


def two_causes(machine: sm.Machine) -> Experiment:
    """Deflections of a machine with two soft drives."""
    plan = random_plan(machine, "deflection", poses=6, loads=6, repeats=2, seed=1)
    soft = machine.with_effect("compliance", element="actuator", legs=["x"], scale=2.0)
    soft = soft.with_effect("compliance", element="actuator", legs=["y"], scale=1.6)
    return simulate(machine, plan, soft.description.effects, seed=2)


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
@pytest.mark.parametrize("when", ["all effects at once", "corrected machine", "readings that no fit saw"])
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
@pytest.mark.parametrize(
    ("quantity", "when"),
    [("deflection", "sensitivities: compliance"), ("position", "sensitivities: tilt")],
)
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
    assert any(what.startswith("compliance at some places") for what in missing) is (
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
        if what in ("all effects at once", "corrected machine"):
            signal.raise_signal(signal.SIGINT)

    machine = sm.load_machine("orthoglide-revised")
    with pytest.raises(KeyboardInterrupt):
        sm.diagnose(machine, two_causes(machine), progress=say)
