"""Pieces of a diagnosis on made-up numbers: rivals, intervals, places of what is left."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Experiment, random_plan
from stiffmap.experiment.experiment import Floats
from stiffmap.identification.diagnosis.candidates.candidates import Candidate, candidates
from stiffmap.identification.diagnosis.decision.largest_residual import located
from stiffmap.identification.diagnosis.decision.patterns import Pattern
from stiffmap.identification.diagnosis.fitting.interval import seen_alone
from stiffmap.identification.diagnosis.fitting.model import Model
from stiffmap.identification.diagnosis.rivals.explain import Rival, p_of_loss
from stiffmap.model.effects import Parameter

ONE = Candidate("length", "bar", ("x",), (Parameter("error", "m", -1.0, 1.0, 0.0, 1e-4, ""),))


@pytest.fixture(scope="module")
def plan() -> Experiment:
    return random_plan(sm.load_machine("orthoglide-revised"), "position", poses=60, seed=3)


def fitted(column: Floats, reading: Floats) -> Model:
    j = column[:, None]
    value = float(column @ reading / (column @ column))
    r = reading - value * column
    return Model((ONE,), np.array([value]), float(r @ r), -j, r)


def test_a_true_rival_is_hardly_ever_refused() -> None:
    rng = np.random.default_rng(5)
    true, false = rng.standard_normal((2, 200))
    false = true + 0.5 * false
    p_values = []
    for _ in range(2000):
        reading = 0.6 * true + rng.standard_normal(200)
        chosen, other = fitted(false, reading), fitted(true, reading)
        gap = float(np.linalg.norm(chosen.residual - other.residual))  # type: ignore[operator]
        p_values.append(p_of_loss(chosen, Rival(other, 0, 0.5, gap, 8.0, False), 199))
    refused = np.mean(np.array(p_values) < 0.05)
    assert refused < 0.07  # the level, within four standard deviations of 2000 draws


def test_a_false_rival_is_refused_where_the_gap_is_wide() -> None:
    rng = np.random.default_rng(6)
    true, false = rng.standard_normal((2, 200))
    reading = true + rng.standard_normal(200)
    chosen, other = fitted(true, reading), fitted(false, reading)
    gap = float(np.linalg.norm(chosen.residual - other.residual))  # type: ignore[operator]
    assert p_of_loss(chosen, Rival(other, 0, 0.5, gap, 14.0, False), 199) < 1e-6


def test_what_others_can_undo_is_not_seen() -> None:
    a, b = np.eye(5)[:2]
    assert seen_alone(np.column_stack([a, a + 0.1 * b]), 1) == pytest.approx(0.1)
    assert seen_alone(np.column_stack([a, 2 * a]), 1) == pytest.approx(0.0, abs=1e-12)


def test_unfelt_parameters_do_not_count() -> None:
    two = replace(ONE, parameters=ONE.parameters * 2)
    model = Model((two,), np.zeros(2), jacobian=np.column_stack([np.ones(4), np.zeros(4)]))
    assert model.freedom == 1


def test_gain_of_all_axes_stands_apart() -> None:
    machine = sm.load_machine("orthoglide-revised")
    deflections = random_plan(machine, "deflection", poses=2, loads=3)
    gains = [c for c in candidates(machine.description, deflections) if c.kind == "load_gain"]
    assert sorted(len(c.parameters) for c in gains) == [1, 3]


def test_a_bump_is_located(plan: Experiment) -> None:
    there = plan.position[20]
    size = 5e-5 * np.exp(-((plan.position - there) ** 2).sum(axis=1) / 0.05**2)
    residual = np.full(plan.reading.shape, np.nan)
    residual[:, 1] = size
    found = located(Pattern("dy", "single poses", 0.0, 100.0), plan, residual, np.full(residual.shape, 1e-6))
    assert found.position == pytest.approx(tuple(there))
    assert found.size == pytest.approx(5e-5, rel=1e-6)


def test_a_step_and_a_wave_are_told_apart(plan: Experiment) -> None:
    x = plan.position[:, 0]
    residual = np.full(plan.reading.shape, np.nan)
    sigma = np.full(residual.shape, 1e-6)
    waves = Pattern("dx", "waves along x", 0.0, 100.0)
    residual[:, 0] = 2e-5 * (x > 0.1)
    assert "a step of +20.0 µm at x" in located(waves, plan, residual, sigma).detail
    residual[:, 0] = 2e-5 * np.sin(2 * np.pi * x / (np.ptp(x) / 2))
    period = f"{1e3 * np.ptp(x) / 2:.3g}"
    assert f"a period of {period} mm" in located(waves, plan, residual, sigma).detail
