"""Where a load never changes its sign, friction and play are offsets; and where a command is the reading."""

from __future__ import annotations

from dataclasses import replace

import stiffmap as sm
from stiffmap.experiment import Experiment, random_plan, simulate
from stiffmap.identification.diagnosis.report.result import Diagnosis
from stiffmap.model.description import AppliedEffect
from stiffmap.model.effects import registry

ZERO = AppliedEffect("zero_offset", "elbow", ("arm",), (("error", 4e-4),))


def arm() -> tuple[sm.Machine, Experiment]:
    machine = sm.load_machine("ur10")
    plan = random_plan(machine, "position", poses=60, seed=3, repeats=1, noise=3e-5)
    return machine, replace(plan, gravity=(0.0, 0.0, -9.81))


def told(d: Diagnosis) -> set[str]:
    """Kinds that the verdict leaves open for its first effect."""
    (found,) = d.effects
    return {found.kind} | {a["kind"] for a in found.aliases}


def test_under_weight_alone_an_offset_goes_before_friction_and_play() -> None:
    machine, plan = arm()
    d = sm.diagnose(machine, simulate(machine, plan, [ZERO], seed=5), cross_validate=False)
    assert [(e.kind, e.element) for e in d.effects] == [("zero_offset", "elbow")]
    assert {"dead_zone", "friction"} <= told(d)
    _, low, high, _ = d.effects[0].parameters["error"]
    assert low < 4e-4 < high


def test_play_read_under_both_signs_is_play() -> None:
    machine = sm.load_machine("orthoglide-revised")
    plan = random_plan(machine, "deflection", poses=8, loads=6, seed=3)
    truth = AppliedEffect("dead_zone", "actuator", ("y",), (("half_width", 1.2e-5),))
    d = sm.diagnose(machine, simulate(machine, plan, [truth], seed=5), cross_validate=False)
    assert [(e.kind, e.legs) for e in d.effects] == [("dead_zone", ("y",))]


def test_kinds_that_a_reversal_shows() -> None:
    reversing = {k for k in registry.kinds() if registry.get(k).reverses}
    assert reversing == {"dead_zone", "friction", "joint_clearance", "joint_friction", "hysteresis"}
