"""An unknown frame and an unknown tool take up what they should of the machine that is found, not of the declared one only."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.python.experiment.virtual.joint_plans import plan_of_joints

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor, random_plan
from stiffmap.experiment.channels import AXES
from stiffmap.experiment.noise.whitening import LinearProblem
from stiffmap.experiment.poses.handeye import Sighting, find_frames
from stiffmap.identification.calibration import calibrate
from stiffmap.identification.inference.corrected import corrected
from stiffmap.identification.inference.kernels import Covariance
from stiffmap.identification.inference.readings import Readings
from stiffmap.identification.numbers import unknowns
from stiffmap.identification.numbers.sensitivity import predicted, sensitivity
from stiffmap.identification.numbers.unknowns import GEOMETRY


def tracked(poses: int, seed: int) -> tuple[sm.Machine, Experiment]:
    """An arm in many configurations, places and orientations of the tool read, frame and tool unknown; it weighs."""
    machine = sm.load_machine("ur10")
    rng = np.random.default_rng(seed)
    home = np.radians([0, -60, 90, -120, -90, 0])
    joints = home + rng.uniform(-0.8, 0.8, (poses, 6))
    plan = replace(
        plan_of_joints(machine, joints, axes=AXES, noise=3e-5, angle_noise=1e-4),
        frame="unknown",
        tool="unknown",
        gravity=(0.0, 0.0, -9.81),
    )
    return machine, plan


@pytest.mark.parametrize(
    "name", ["shift of platform.end along z", "turn of platform.end about x", "zero of arm.wrist_3"]
)
def test_a_tool_that_is_unknown_hides_its_own_errors_at_the_fit(name: str) -> None:
    machine, plan = tracked(25, 2)
    predictor = Predictor(machine, plan)
    wanted = unknowns(machine.description, predictor.experiment)
    off = 3.0 * np.random.default_rng(0).standard_normal(len(wanted))
    here = predicted(predictor, wanted, off)
    which = [u.name for u in wanted].index(name)
    moved = off.copy()
    moved[which] += 0.1
    change = predicted(predictor, wanted, moved) - here
    e = predictor.experiment
    problem = LinearProblem.of(e, e.sigma, here)
    left = np.linalg.norm(problem.white(change)) / np.linalg.norm(
        change[problem.index] / problem.sigma[problem.index]
    )
    assert left < 1e-4


def test_the_calibration_uses_the_frames_at_its_fit() -> None:
    machine, plan = tracked(40, 3)
    predictor = Predictor(machine, plan)
    wanted = unknowns(machine.description, predictor.experiment)
    rng = np.random.default_rng(1)
    exact = predicted(predictor, wanted, 3.0 * rng.standard_normal(len(wanted)))
    data = plan.with_readings(exact + plan.sigma * rng.standard_normal(exact.shape))
    c = calibrate(machine, data)
    assert c.after.rms < 1.1 * c.noise
    assert c.held_out is not None and c.held_out.after.rms < 1.3 * c.noise < 0.1 * c.held_out.before.rms


def test_at_the_end_the_frames_are_those_of_the_machine_that_was_found() -> None:
    """The gradient of misfit and prior, in standard deviations of each number, is small with frames and tool taken there, 6 mrad off."""
    machine, plan = tracked(40, 3)
    predictor = Predictor(machine, plan)
    wanted = unknowns(machine.description, predictor.experiment)
    rng = np.random.default_rng(1)
    exact = predicted(predictor, wanted, 6.0 * rng.standard_normal(len(wanted)))
    p = Predictor(machine, plan.with_readings(exact + plan.sigma * rng.standard_normal(exact.shape)))
    rows, channel = np.nonzero(p.experiment.read)
    n, s = len(rows), sensitivity(p, wanted)
    rest, spread = Covariance(np.ones(n), np.zeros((n, 0))), np.full(len(s.unknowns), 6.0)
    found = corrected(Readings(p, plan.sigma, rows, channel, 1.0, np.ones(n), rest, s, spread), ())
    given = found.given
    left = given.white(p.experiment.reading - found.prediction)
    q = given.frames(found.prediction)
    columns = given.columns - q @ (q.T @ given.columns)
    gradient = found.numbers / spread - columns.T @ (left - q @ (q.T @ left))
    assert np.abs(gradient / np.sqrt(1.0 + np.sum(columns**2, axis=0))).max() < 3.0


def test_a_target_whose_tool_never_turns_is_not_found_a_metre_off() -> None:
    """Its place cannot be told: errors of angle, times a metre, would else be taken for errors of position."""
    machine = sm.load_machine("ur10")
    plan = random_plan(machine, "position", poses=100, seed=1, repeats=1)
    joints = sm.inverse_kinematics(machine, plan.position).actuators
    r = sm.forward_kinematics(machine, joints).rotation
    plan = replace(
        plan, rotation=r, rotation_against="base", joints=joints, joint_names=tuple(machine.actuators)
    )
    predictor = Predictor(machine, plan)
    wanted = [u for u in unknowns(machine.description, predictor.experiment) if u.group in GEOMETRY]
    moved = predicted(predictor, wanted, 3.0 * np.random.default_rng(0).standard_normal(len(wanted)))
    turned = Rotation.from_rotvec(moved[:, 3:6]).as_matrix() @ r
    at, ones = np.array([0.0, 0.02, 0.1]), np.zeros(len(plan), int)
    seen = Sighting(plan.position, r, plan.position + moved[:, :3] + turned @ at, turned, ones, ones)
    assert np.linalg.norm(find_frames(seen).tool_p) < 0.01
