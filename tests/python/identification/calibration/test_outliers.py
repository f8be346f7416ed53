"""Poses that were read once and stand alone are set aside and named."""

from __future__ import annotations

import numpy as np

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor, random_plan
from stiffmap.identification.calibration import calibrate


def read_once(poses: int, seed: int = 1) -> tuple[sm.Machine, Experiment]:
    """An arm without errors; no pose is read twice."""
    machine = sm.load_machine("ur10")
    plan = random_plan(machine, "position", poses=poses, repeats=1, seed=seed)
    noise = np.nan_to_num(plan.sigma) * np.random.default_rng(seed).standard_normal(plan.reading.shape)
    return machine, plan.with_readings(Predictor(machine, plan)() + noise)


def wild(data: Experiment, rows: list[int]) -> Experiment:
    reading = data.reading.copy()
    reading[rows, 1] += 2e-3
    return data.with_readings(reading)


def test_a_pose_that_was_read_once_may_be_an_outlier_and_is_named() -> None:
    machine, data = read_once(100)
    c = calibrate(machine, wild(data, [16, 60]))
    assert c.outliers == (data.ids[16], data.ids[60])
    assert f"set aside as outliers: rows {data.ids[16]}, {data.ids[60]}" in str(c)
    assert c.verdict == "as declared"


def test_many_of_them_are_structure() -> None:
    machine, data = read_once(100)
    assert not calibrate(machine, wild(data, [5, 16, 40, 60])).outliers
