"""Dry friction of a passive joint, read on both branches."""

from __future__ import annotations

from dataclasses import replace

import stiffmap as sm
from stiffmap.experiment import random_plan, simulate
from stiffmap.model.description import AppliedEffect


def test_friction_of_a_joint_is_told_from_that_of_a_drive() -> None:
    machine = sm.load_machine("orthoglide-revised")
    plan = random_plan(machine, "deflection", poses=12, loads=6, seed=3)
    plan = replace(plan, branch=tuple("loading" if i % 2 else "unloading" for i in range(len(plan))))
    truth = AppliedEffect("joint_friction", "proximal", ("y",), (("torque", 6.0),))
    d = sm.diagnose(machine, simulate(machine, plan, [truth], seed=5), cross_validate=False)
    assert d.verdict == "effects", str(d)
    (found,) = d.effects
    assert (found.kind, found.element, found.legs) == ("joint_friction", "proximal", ("y",))
    _, low, high, _ = found.parameters["torque"]
    assert low <= 6.0 <= high
