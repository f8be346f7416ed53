"""Periodic errors of many readings: columns that are made where they are asked for."""

from __future__ import annotations

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import random_plan, simulate
from stiffmap.experiment.noise.whitening import readings_of
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.candidates.sensitivity import Wave, plan_of


@pytest.mark.parametrize("leg", ["x", "z"])
def test_columns_of_a_period_are_what_the_machine_does(leg: str) -> None:
    """Against whole predictions with the effect, at its zero phase and a quarter period on; of some readings and of all."""
    machine = sm.load_machine("orthoglide-revised")
    data = simulate(machine, random_plan(machine, "position", poses=12, seed=1), seed=2)
    predictor = Predictor(machine, data)
    plan = plan_of(predictor)
    mine = [v for v in plan.variants if v.candidate.kind == "periodic_error" and v.candidate.legs == (leg,)]
    v = mine[len(mine) // 2]
    assert isinstance(v.columns, Wave)
    size = 1e-6
    given = {**dict(v.shape), "amplitude": size}
    index = readings_of(data, plan.base)
    some = np.arange(0, len(index[0]), 5)
    for k, phase in enumerate((0.0, 0.5 * np.pi)):
        moved = predictor(
            [v.candidate.term([{**given, "phase": phase}[p.name] for p in v.candidate.parameters])]
        )
        slope = (moved - plan.base)[index] / size
        assert v.start is not None
        unit = np.linalg.lstsq(v.lines()[k][:, None], slope, rcond=None)[0][0]
        assert unit * v.lines()[k] == pytest.approx(slope, abs=1e-3 * np.abs(slope).max())
        assert v.lines(some)[k] == pytest.approx(v.lines()[k][some], rel=1e-12)
