"""How much a diagnosis tries, and what it keeps for later."""

from __future__ import annotations

import stiffmap as sm
from stiffmap.diagnosis import clock
from stiffmap.diagnosis.clock import Clock
from stiffmap.experiment import Experiment, random_plan, simulate
from stiffmap.experiment.prediction.kept import Kept


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
    c.bound(lambda: made[0], clock.ROWS)
    c.begin_search()
    made[0] = clock.SHARE * clock.MOST + 1.0
    assert c.tired and not c.spent
    c.begin_search()
    assert not c.tired
    made[0] = clock.MOST + 1.0
    assert c.tired and c.spent


def test_more_rows_allow_fewer_predictions() -> None:
    c = Clock()
    c.bound(lambda: 10.0, 4 * clock.ROWS)
    assert c.most == 10 + clock.MOST / 2


def test_what_was_asked_for_longest_ago_goes_first() -> None:
    kept: Kept[str, int] = Kept(most=10)
    kept.put("a", 1, 4)
    kept.put("b", 2, 4)
    assert kept.get("a") == 1
    kept.put("c", 3, 4)
    assert (kept.get("a"), kept.get("b"), kept.get("c")) == (1, None, 3)
    kept.put("c", 4, 6)
    assert (len(kept), kept.bytes, kept.effort) == (2, 10, 4)
