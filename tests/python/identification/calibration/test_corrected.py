"""The machine file that a calibration or a diagnosis gives is what its numbers are about."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.python.experiment.virtual.joint_plans import plan_of_joints

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.noise.whitening import LinearProblem, best_fit, unseen_nuisances
from stiffmap.identification.calibration import Calibration, calibrate
from stiffmap.identification.calibration.result import in_display_units
from stiffmap.identification.inference.travel import Profile, knots_of
from stiffmap.model.description.tree import joints

NOISE = 1e-5
RIPPLE = {"amplitude": 3e-4, "period": 0.5, "phase": 0.4}


def plan_of(poses: int, seed: int) -> tuple[sm.Machine, Experiment]:
    machine = sm.load_machine("ur10")
    joints = np.radians([0, -60, 90, -120, -90, 0]) + np.random.default_rng(seed).uniform(
        -0.7, 0.7, (poses, 6)
    )
    return machine, plan_of_joints(machine, joints, noise=NOISE)


def read(plan: Experiment, machine: sm.Machine, seed: int) -> Experiment:
    exact = Predictor(machine, plan)()
    noise = np.nan_to_num(plan.sigma) * np.random.default_rng(seed).standard_normal(exact.shape)
    return plan.with_readings(exact + noise)


def true_machine(machine: sm.Machine) -> sm.Machine:
    return machine.with_effect("periodic_error", element="shoulder", **RIPPLE).with_effect(
        "zero_offset", element="elbow", error=4e-4
    )


@pytest.fixture(scope="module")
def calibrated() -> tuple[Calibration, sm.Machine]:
    machine, plan = plan_of(120, 7)
    return calibrate(machine, read(plan, true_machine(machine), 1)), machine


def left_by(machine: sm.Machine, experiment: Experiment) -> float:
    residual = experiment.reading - Predictor(machine, experiment)()
    return float(np.sqrt(np.nanmean(np.sum(residual[:, :3] ** 2, axis=1) / 3)))


def test_the_file_does_on_new_readings_what_was_said(
    calibrated: tuple[Calibration, sm.Machine], tmp_path: Path
) -> None:
    c, declared = calibrated
    c.machine.save(tmp_path / "machine.yaml")
    _, plan = plan_of(300, 99)
    fresh = read(plan, true_machine(declared), 2)
    assert c.profiles and c.held_out is not None and c.promise is not None
    before, after = (left_by(m, fresh) for m in (declared, sm.load_machine(tmp_path / "machine.yaml")))
    assert after / before == pytest.approx(c.held_out.after.rms / c.held_out.before.rms, rel=0.15)
    assert after == pytest.approx(c.promise[0], rel=0.15)
    assert after < 3.0 * NOISE < 0.2 * before


def test_frames_are_not_fitted_to_what_is_held_out() -> None:
    rng = np.random.default_rng(0)
    machine, plan = plan_of(12, 3)
    plan = replace(plan, frame="unknown")
    base = Predictor(machine, plan)()
    shown: Floats = rng.standard_normal(base.shape) * 1e-4
    e = plan.with_readings(base + shown)
    test = np.arange(12) % 3 == 0
    others, own = (LinearProblem.of(e, e.sigma, base, keep) for keep in (~test, test))
    said = unseen_nuisances(others, own, shown)
    changed = shown.copy()
    changed[test] += 1.0  # what is held out has no say
    assert unseen_nuisances(others, own, changed)[test] == pytest.approx(said[test], abs=1e-12)
    assert np.abs(best_fit(own, np.ones((*base.shape, 1)), shown)).max() > 0.0


def test_errors_of_a_turning_drive_return_with_its_turns() -> None:
    (joint,) = (j for n, j in joints(sm.load_machine("ur10").description).items() if n.endswith("elbow"))
    knots = ((-1.0, 1e-4), (0.5, 3e-4), (2.0, -1e-4))
    at, error = np.array(knots).T
    profile = Profile("arm.elbow", "rad", at, error, np.zeros(3))
    made = knots_of(joint, profile)  # its range is a turn to either side
    u = np.array([-0.3, 0.7, 1.9])
    error = np.interp(u, *np.array(knots).T)
    for turns in (-1, 0, 1):
        assert np.interp(u + 2 * np.pi * turns, *np.array(made).T) == pytest.approx(error)
    sliding = next(iter(joints(sm.load_machine("linear-delta").description).values()))
    assert knots_of(sliding, profile) == knots


def test_per_cent_are_per_cent() -> None:
    assert in_display_units(float(np.log(1.25)), "ln") == "25 %"
    assert in_display_units(float(np.log(0.8)), "ln") == "-20 %"
    assert in_display_units(3.5, "ln") == "×33.12"  # not 350 %
    assert in_display_units(2e-3, "m") == "2 mm"
