"""Errors along the drives' travel, found in what a calibrated arm leaves."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.python.experiment.virtual.joint_plans import plan_of_joints

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor, random_plan
from stiffmap.experiment.experiment import Floats
from stiffmap.identification.calibration import Calibration, calibrate
from stiffmap.identification.diagnosis import answer
from stiffmap.identification.inference.corrected import Corrected, machine_of
from stiffmap.identification.inference.machines import written
from stiffmap.identification.inference.travel import DriveErrors, apart, hats
from stiffmap.model.with_errors import edited
from stiffmap.ui.cli.calibrate import write

AMPLITUDE, PERIOD = 3e-4, 0.5
RIPPLE = {"amplitude": AMPLITUDE, "period": PERIOD, "phase": 0.4}


def arm(poses: int = 250) -> tuple[sm.Machine, Experiment, Floats]:
    """An arm commanded by its joints, positions read, and the shoulder's coordinate."""
    machine = sm.load_machine("ur10")
    rng = np.random.default_rng(7)
    joints = np.radians([0, -60, 90, -120, -90, 0]) + rng.uniform(-0.7, 0.7, (poses, 6))
    plan = replace(plan_of_joints(machine, joints, noise=1e-5), frame="unknown")
    return machine, plan, joints[:, 1]


def read(plan: Experiment, exact: Floats, more: float = 0.0) -> Experiment:
    """With noise, and an error of the model (m) that every pose has for itself."""
    rng = np.random.default_rng(1)
    size = np.nan_to_num(np.hypot(plan.sigma, more))
    return plan.with_readings(exact + size * rng.standard_normal(exact.shape))


@pytest.fixture(scope="module")
def rippled() -> tuple[Calibration, Floats]:
    machine, plan, shoulder = arm()
    off = machine.with_effect("periodic_error", element="shoulder", **RIPPLE)
    return calibrate(machine, read(plan, Predictor(off, plan)())), shoulder


def test_a_wave_of_a_gear_is_told_along_its_drive(rippled: tuple[Calibration, Floats]) -> None:
    c, _ = rippled
    first = max(c.shares, key=lambda name: c.shares[name])
    assert first.startswith("arm.shoulder along its travel") and c.shares[first] > 0.8
    assert first in str(c)
    assert c.held_out is not None and c.held_out.after.rms < 0.3 * c.held_out.before.rms
    assert c.verdict in ("as declared", "adjusted within tolerance")


def test_the_profile_is_the_wave(rippled: tuple[Calibration, Floats]) -> None:
    c, shoulder = rippled
    (found,) = (p for p in c.profiles if p.drive == "arm.shoulder")
    at = np.linspace(np.quantile(shoulder, 0.05), np.quantile(shoulder, 0.95), 200)
    told = np.interp(at, found.at, found.error)
    home = np.radians(-60)
    true = AMPLITUDE * np.sin(2 * np.pi * (at - home) / PERIOD + RIPPLE["phase"])
    line = np.column_stack([np.ones_like(at), at])  # zero and gain are the calibration's
    left = [v - line @ np.linalg.lstsq(line, v, rcond=None)[0] for v in (told, true)]
    assert np.corrcoef(left[0], left[1])[0, 1] > 0.95
    assert np.std(left[0]) == pytest.approx(np.std(left[1]), rel=0.15)
    off = np.abs(left[0] - left[1])
    assert np.mean(off < 3.0 * np.interp(at, found.at, found.sigma)) > 0.8


def test_files_have_the_profiles(rippled: tuple[Calibration, Floats], tmp_path: Path) -> None:
    c, _ = rippled
    write(c, tmp_path)
    lines = (tmp_path / "travel.csv").read_text().splitlines()
    assert lines[0] == "drive,coordinate,error,sigma,unit"
    assert any(line.startswith("arm.shoulder,") and line.endswith(",deg") for line in lines)
    travel = json.loads((tmp_path / "calibration.json").read_text())["travel"]
    assert "arm.shoulder" in [p["drive"] for p in travel]


def test_errors_that_follow_no_drive_make_no_profile() -> None:
    machine, plan, _ = arm(60)
    for more in (1e-4, 0.0):
        c = calibrate(machine, read(plan, Predictor(machine, plan)(), more=more))
        assert sum(s for name, s in c.shares.items() if "travel" in name) < 0.02


def test_a_profile_has_no_mean_and_no_slope() -> None:
    """Those are the drive's zero and gain."""
    knots = np.array([0.0, 0.1, 0.4, 0.5, 0.9, 1.4])
    drive = DriveErrors("a", "rad", np.ones((3, 6)), np.array([0.0, 0.7, 1.4]), knots)
    root = drive.root({name: 2.0 for name, _ in drive.names()})
    assert np.abs(np.stack([np.ones(6), knots]) @ root).max() < 1e-12
    assert np.linalg.matrix_rank(root) == 4


def test_knots_that_round_off_alone_keeps_apart_are_one() -> None:
    assert apart(np.array([0.5, 0.1, 0.1 + 1e-16, 0.1 + 1e-13, 0.5])) == pytest.approx([0.1, 0.5])


def test_hats_are_straight_between_knots() -> None:
    x = np.array([-1.0, 0.0, 0.25, 1.0, 3.0, 9.0])
    made = hats(x, np.array([0.0, 1.0, 3.0]))
    assert made @ [0.0, 2.0, 4.0] == pytest.approx([0.0, 0.0, 0.5, 2.0, 4.0, 4.0])
    assert made.sum(axis=1) == pytest.approx(np.ones(6))


def test_drives_of_the_platform_have_a_travel_too() -> None:
    """Those of the hybrid's wrist have no leg: their coordinates go by another name than their elements."""
    machine = sm.load_machine("hybrid")
    built = machine.with_effect("periodic_error", element="a", amplitude=3e-4, period=0.7, phase=0.2)
    plan = random_plan(machine, "position", poses=40, repeats=1, seed=2)
    far = built.with_effect(
        "periodic_error", element="carriage", legs=["b"], amplitude=6e-5, period=0.05, phase=0.2
    )
    c = sm.calibrate(machine, plan.with_readings(Predictor(far, plan)()))
    assert c.verdict == "unattributed"
    assert set(c.validity.drives) == {"a.carriage", "b.carriage", "c.carriage", "a", "b"}
    assert "a 0 deg" in str(c.validity)


def test_a_corrected_machine_has_what_waves_leave_along_the_travel(monkeypatch: pytest.MonkeyPatch) -> None:
    """A bump of one screw next to a wave of another: no effect is a bump, and a file without it predicts worse than a calibration."""
    machine = sm.load_machine("orthoglide-original")
    plan = random_plan(machine, "position", poses=80, repeats=1, seed=2)
    rippled = machine.with_effect(
        "periodic_error", element="actuator", legs=["y"], amplitude=5e-5, period=0.05, phase=0.2
    )
    at = np.linspace(-0.42, -0.177, 9)
    bump = 8e-5 * np.array([0.0, 0.0, 0.0, 1.0, 1.0, -0.3, 0.0, 0.0, 0.0])
    knots = {"z.actuator": tuple(zip(at.tolist(), bump.tolist(), strict=True))}
    off = sm.Machine(edited(rippled.description, {}, knots), like=rippled)
    e = read(plan, Predictor(off, plan)())
    models: dict[str, Corrected] = {}
    monkeypatch.setattr(
        answer, "written", lambda some, *a, **k: models.update(some) or written(some, *a, **k)
    )
    d, c = sm.diagnose(machine, e), calibrate(machine, e)
    assert d.which == "corrected" and ("periodic_error", ("y",)) in [
        (f.kind, tuple(f.legs)) for f in d.effects
    ]
    assert c.held_out is not None and d.after.rms < c.held_out.after.rms
    (y,) = (f for f in d.effects if tuple(f.legs) == ("y",))
    (kept,) = (f for f in d.machine.description.effects if f.legs == ("y",))
    assert dict(kept.parameters)["amplitude"] == y.parameters["amplitude"][0]
    beside, alone = (Predictor(m, plan)() for m in (machine_of(models["calibrated"]), c.machine))
    assert beside == pytest.approx(alone, abs=1e-9, nan_ok=True)  # it competes with what `calibrate` gives
    best = models["corrected"]  # its numbers and its travel are at their optimum, too: no slope is left
    given = best.given
    q = given.frames(best.prediction)
    left = given.white(np.nan_to_num(e.reading - best.prediction))
    columns = np.hstack([given.columns, given.along])
    slope = columns.T @ (left - q @ (q.T @ left)) - best.others
    assert np.linalg.norm(slope) < 0.02 * np.linalg.norm(best.others)
