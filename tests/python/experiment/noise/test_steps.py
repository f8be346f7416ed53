"""Readings of a dial are no surer than its steps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Experiment, random_plan
from stiffmap.experiment.comparison.limitations import limitations
from stiffmap.experiment.noise.level import noise_of

MACHINE = sm.load_machine("five-bar")


def dial(step: float, declared: float) -> Experiment:
    """Twenty conditions, each read twice to the same number; only dx is rounded."""
    rng = np.random.default_rng(1)
    e = random_plan(MACHINE, "deflection", poses=10, loads=2, repeats=2, seed=1)
    value = rng.normal(0.0, 5e-5, (int(e.conditions.max()) + 1, len(e.channels)))[e.conditions]
    if step:
        value[:, 0] = np.round(value[:, 0] / step) * step
    value[:, 1] += rng.normal(0.0, declared, len(e))
    return replace(e.with_readings(np.where(e.read, value, np.nan)), sigma=np.where(e.read, declared, np.nan))


def test_the_noise_is_at_least_that_of_the_step() -> None:
    step = 1e-5
    e = dial(step, 1e-6)
    noise = noise_of(e)
    assert noise.step[:2] == pytest.approx([step, 0.0])
    assert noise.floor[:2] == pytest.approx([step / np.sqrt(12.0), 1e-6], rel=0.5)
    assert any(t.startswith("dx is read in steps of 0.01 mm") for t in limitations(e, noise, MACHINE))


def test_repeats_that_are_rounded_alike_are_no_surer_together() -> None:
    noise = noise_of(dial(1e-5, 3e-6))
    assert noise.sigma[0, 0] == pytest.approx(np.sqrt(3e-6**2 + 1e-10 / 12.0))
    assert noise.sigma[0, 1] == pytest.approx(noise.floor[1])


def test_readings_with_more_digits_have_no_step() -> None:
    noise = noise_of(dial(0.0, 1e-6))
    assert noise.step[:2] == pytest.approx([0.0, 0.0]) and not noise.coarse()
