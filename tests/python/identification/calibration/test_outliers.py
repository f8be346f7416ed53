"""Poses that were read once and stand alone are set aside and named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor, random_plan
from stiffmap.experiment.noise.outliers import without_suspects
from stiffmap.identification.calibration import Calibration, calibrate


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


def test_poses_that_were_read_once_are_named_and_the_rest_is_as_without_them() -> None:
    machine, data = read_once(100)
    clean, spoiled = calibrate(machine, data), calibrate(machine, wild(data, [16, 60]))
    assert spoiled.outliers == (data.ids[16], data.ids[60])
    assert f"set aside as outliers: rows {data.ids[16]}, {data.ids[60]}" in str(spoiled)
    assert spoiled.verdict == "as declared"
    assert spoiled.after.rms == pytest.approx(clean.after.rms, rel=0.05)
    assert spoiled.scale == pytest.approx(clean.scale, rel=0.1)


def off(machine: sm.Machine, data: Experiment) -> Experiment:
    """Zeros of four drives a milliradian off, frame and reflector unknown."""
    far = machine
    for k, name in enumerate(("shoulder", "elbow", "wrist_1", "wrist_2")):
        far = far.with_effect("zero_offset", element=name, error=(1e-3, -1.5e-3, 8e-4, -6e-4)[k])
    shown = Predictor(far, data)() - Predictor(machine, data)()
    return replace(data.with_readings(data.reading + shown), frame="unknown", tool="offset_unknown")


@pytest.fixture(scope="module")
def unspoiled() -> tuple[sm.Machine, Experiment, Calibration]:
    machine, data = read_once(30, 4)
    return machine, off(machine, data), calibrate(machine, off(machine, data))


@pytest.mark.parametrize(("row", "by"), [(3, 0.6), (3, 5e-3), (21, 2e-2), (21, 1e-3)])
def test_one_row_that_slipped_is_named_whatever_its_size(
    by: float, row: int, unspoiled: tuple[sm.Machine, Experiment, Calibration]
) -> None:
    """Unknown frames, fitted by least squares, would spread it over all others."""
    machine, data, clean = unspoiled
    reading = data.reading.copy()
    reading[row, :3] += by * np.array([0.8, -0.5, 0.33])
    spoiled = data.with_readings(reading)
    c = calibrate(machine, spoiled)
    assert c.outliers == (data.ids[row],)
    assert c.verdict == clean.verdict
    assert c.held_out is not None and clean.held_out is not None
    assert c.held_out.after.rms == pytest.approx(clean.held_out.after.rms, rel=0.25)
    if by > 2e-3:
        assert sm.residual(machine, spoiled).set_aside[row]


def test_two_rows_that_were_swapped_are_named_as_such() -> None:
    machine, data = read_once(30, 5)
    e = off(machine, data)
    reading = e.reading.copy()
    where = e.position[[4, 17]]
    reading[4, :3], reading[17, :3] = (
        e.reading[17, :3] + where[1] - where[0],
        e.reading[4, :3] + where[0] - where[1],
    )
    c = calibrate(machine, e.with_readings(reading))
    assert c.swapped == ((e.ids[4], e.ids[17]),)
    assert f"rows {e.ids[4]} and {e.ids[17]} fit as swapped: each as the reading of the other" in c.lines()


def test_one_that_is_far_off_hides_no_other() -> None:
    """Of repeats: the noise floor is that of the others."""
    machine = sm.load_machine("linear-delta")
    plan = random_plan(machine, "deflection", poses=6, loads=4, repeats=3, seed=3)
    rng = np.random.default_rng(0)
    data = plan.with_readings(
        Predictor(machine, plan)() + np.nan_to_num(plan.sigma) * rng.standard_normal(plan.reading.shape)
    )
    reading = data.reading.copy()
    reading[4, 0] += 1e-2
    reading[10, 0] += 2e-4
    noise, out = without_suspects(data.with_readings(reading), Predictor(machine, data)())
    assert np.flatnonzero(out).tolist() == [4, 10]
    assert noise.floor[0] < 1.5 * plan.sigma[0, 0]
