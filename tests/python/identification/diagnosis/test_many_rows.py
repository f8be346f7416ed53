"""Periodic errors of many readings: columns that are made where they are asked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import random_plan, simulate
from stiffmap.experiment.noise.whitening import readings_of
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.candidates.sensitivity import OneOf, plan_of


@pytest.mark.parametrize("leg", ["x", "z"])
def test_columns_of_a_period_are_what_the_machine_does(leg: str) -> None:
    """Against whole predictions with the effect, at its zero phase and a quarter period on; of some readings and of all."""
    machine = sm.load_machine("orthoglide-revised")
    data = simulate(machine, random_plan(machine, "position", poses=12, seed=1), seed=2)
    predictor = Predictor(machine, data)
    plan = plan_of(predictor)
    mine = [v for v in plan.variants if v.candidate.kind == "periodic_error" and v.candidate.legs == (leg,)]
    v = mine[len(mine) // 2]
    assert isinstance(v.columns, OneOf)
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


@pytest.mark.parametrize("most", [5, 1000])
def test_columns_of_a_jump_are_what_the_instrument_shows(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Against whole predictions with it; rows stand in another order than they were read, and some orders are the same."""
    monkeypatch.setattr("stiffmap.model.effects.library.measurement.MOST_JUMPS", most)
    machine = sm.load_machine("orthoglide-revised")
    data = simulate(machine, random_plan(machine, "position", poses=12, seed=1), seed=2)
    order = np.random.default_rng(most).permutation(len(data) // 2).repeat(2).astype(float) + 7.0
    predictor = Predictor(machine, replace(data, order=order))
    plan = plan_of(predictor)
    index = readings_of(predictor.experiment, plan.base)
    mine = [v for v in plan.variants if v.candidate.kind == "frame_jump"]
    assert len(mine) == min(most, len(np.unique(order)) - 1) and mine[-1].shape == (("since", order.max()),)
    for v in mine:
        for line, p in zip(v.lines(), v.candidate.linear, strict=True):
            moved = predictor([v.candidate.term_of({**dict(v.shape), p.name: p.scale})])
            np.testing.assert_allclose(line, (moved - plan.base)[index], atol=1e-15)
