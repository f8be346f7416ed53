"""A diagnosis with a known answer, that the slow tests of pages share."""

from __future__ import annotations

from functools import cache

import stiffmap as sm
from stiffmap.experiment import random_plan, simulate
from stiffmap.model.description import AppliedEffect


@cache
def soft_drive() -> sm.Diagnosis:
    """The drive of leg z is 2.15 times as soft as declared."""
    machine = sm.load_machine("orthoglide-revised")
    term = AppliedEffect("compliance", "actuator", ("z",), (("scale", 2.15),))
    data = simulate(machine, random_plan(machine, "deflection", poses=12, seed=7), [term], seed=5)
    return sm.diagnose(machine, data, seed=1, cross_validate=False)
