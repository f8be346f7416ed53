"""What numbers within their tolerances may be is no cause."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor, random_plan
from stiffmap.identification.numbers import unknowns
from stiffmap.identification.numbers.sensitivity import predicted
from stiffmap.model.description import AppliedEffect
from stiffmap.model.effects import parse_effect


def twin(
    name: str, quantity: str, poses: int, seed: int, *effects: AppliedEffect, off: float = 0.3
) -> Experiment:
    """Of a machine with effects whose every number is drawn from `off` times its uncertainty."""
    machine = sm.load_machine(name)
    plan = random_plan(machine, quantity, poses=poses, loads=6, repeats=2, seed=1)
    predictor = Predictor(machine, plan)
    plan = predictor.experiment  # without rows out of reach
    wanted = unknowns(machine.description, plan)
    rng = np.random.default_rng(seed)
    reading = predicted(predictor, wanted, off * rng.standard_normal(len(wanted)), effects)
    reading = reading + np.nan_to_num(plan.sigma) * rng.standard_normal(reading.shape)
    return replace(plan, reading=np.where(plan.read, reading, np.nan), joints=None)


def diagnosed(name: str, quantity: str, poses: int, seed: int) -> sm.Diagnosis:
    return sm.diagnose(sm.load_machine(name), twin(name, quantity, poses, seed), cross_validate=False)


def test_positions_of_an_arm_better_than_declared() -> None:
    """Nothing is named, so that the file has numbers adjusted: it is calibrated, not corrected."""
    d = diagnosed("ur10", "position", 15, 3)
    assert (d.verdict, d.effects, d.which) == ("none", [], "calibrated")


@pytest.mark.parametrize("seed", [5070, 5097])
def test_deflections_of_a_delta_better_than_declared(seed: int) -> None:
    """A lone error explains these readings as well as all compliances within 6 % do, by 0.6 and 0.1 nats."""
    d = diagnosed("linear-delta", "deflection", 10, seed)
    assert (d.verdict, d.effects) == ("none", [])


@pytest.mark.parametrize("leg", ["a", "b"])
def test_of_a_drive_that_is_named_soft_the_others_are_within_tolerance(leg: str) -> None:
    """Its own compliance is no reason to call those of all drives further off than the file says."""
    machine, soft = sm.load_machine("linear-delta"), parse_effect(f"compliance carriage {leg} scale=3")
    readings = twin("linear-delta", "deflection", 6, 1, soft, off=1.0)
    d = sm.diagnose(machine, readings, cross_validate=False)
    assert [(e.kind, e.element, e.legs) for e in d.effects] == [("compliance", "carriage", (leg,))]
    assert d.calibration is not None and not d.calibration.wide
    c = sm.calibrate(machine, readings)
    assert (c.verdict, c.wide) == (f"beyond tolerance: compliance of {leg}.carriage", ())
