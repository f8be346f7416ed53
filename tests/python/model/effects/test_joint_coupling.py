"""Drives that move with other joints: as an error of the machine, and as what a controller shows."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from tests.oracle.check import checks
from tests.oracle.classes import Classes

import stiffmap as sm
from stiffmap.experiment.prediction.joints import _command_error as error_in_python
from stiffmap.model.effects import get

PER_TURN = 0.03
RNG = np.random.default_rng(4)
FIVE_BAR = sm.load_machine("five-bar")
ARM = sm.load_machine("ur10")
SCARA = """
name: scara
units: {length: m, force: N, angle: rad, mass: kg}
home: {translation: [0.4, 0, 0.2]}
task: [x, y, z, rz]
legs:
  arm:
    elements:
      - {actuator: j1, kind: revolute, axis: z, home: 0, rigid: true}
      - {offset: upper, translation: [0.2, 0, 0.2]}
      - {actuator: j2, kind: revolute, axis: z, home: 0, rigid: true}
      - {offset: lower, translation: [0.2, 0, 0]}
      - {actuator: j4, kind: revolute, axis: z, home: 0, rigid: true}
      - {actuator: j3, kind: prismatic, axis: z, home: 0, rigid: true}
"""


def arm_drives(n: int) -> np.ndarray:
    """(n, 6) rad, about home."""
    home = ARM.compiled.home_coordinates()
    mine = [ARM.compiled.names.joints[a] for a in ARM.actuators]
    return np.asarray(home[mine] + RNG.uniform(-0.4, 0.4, (n, 6)))


def pose(machine: sm.Machine, drives: np.ndarray, **options: str) -> tuple[np.ndarray, np.ndarray]:
    """Where a machine truly stands at drives without load, m, and what its displacement is."""
    s = machine.solve_joints(drives, **options)
    return s.unloaded.position + s.displacement[..., :3], s.displacement


@pytest.mark.parametrize("method", ["fast", "reference"])
def test_a_drive_of_an_arm_turns_with_the_one_before_it(method: str) -> None:
    drives = arm_drives(5)
    i, k = 2, 1
    at = {a: n for n, a in enumerate(ARM.actuators)}
    leg, first = ARM.actuators[k].split(".")
    second = ARM.actuators[i].split(".")[1]
    real = ARM.with_effect("joint_coupling", element=f"{second}.{first}", legs=[leg], per_turn=PER_TURN)
    home = ARM.compiled.home_coordinates()[ARM.compiled.names.joints[ARM.actuators[k]]]
    truly = drives.copy()
    truly[:, at[ARM.actuators[i]]] += PER_TURN * (drives[:, k] - home) / (2 * np.pi)
    expected = sm.forward_kinematics(ARM, truly).position
    for machine, commanded in ((real, drives), (ARM, truly)):
        found, _ = pose(machine, commanded, method=method)
        np.testing.assert_allclose(found, expected, atol=1e-9)
    by_pose = sm.forward_kinematics(ARM, drives)
    s = real.solve(by_pose.position, rotation=by_pose.rotation, start=by_pose.coordinates, method=method)
    np.testing.assert_allclose(by_pose.position + s.displacement[..., :3], expected, atol=1e-9)


@pytest.mark.parametrize("method", ["fast", "reference"])
def test_a_drive_that_turns_with_a_passive_joint_is_off_by_what_that_has_turned(method: str) -> None:
    names = FIVE_BAR.compiled.names
    drive = FIVE_BAR.actuators[0]
    leg, motor = drive.split(".")
    passive = next(n for n in names.joints if n.startswith(f"{leg}.") and n != drive)
    element = f"{motor}.{passive.split('.')[1]}"
    real = FIVE_BAR.with_effect("joint_coupling", element=element, legs=[leg], per_turn=PER_TURN)
    i = names.joints[passive]
    home = FIVE_BAR.compiled.home_coordinates()[i]
    wrench = np.array([15.0, -25.0, 0.0, 0.0, 0.0, 0.0])
    for shift in RNG.uniform(-0.05, 0.05, (4, 2)):
        position = FIVE_BAR.description.home.p + np.append(shift, 0.0)
        turned = sm.inverse_kinematics(FIVE_BAR, position).coordinates[i] - home
        plain = FIVE_BAR.with_effect(
            "zero_offset", element=motor, legs=[leg], error=PER_TURN * float(turned) / (2 * np.pi)
        )
        one, other = (m.solve(position, wrench, method=method) for m in (real, plain))
        assert one.status == other.status
        np.testing.assert_allclose(one.displacement, other.displacement, atol=1e-11)
        np.testing.assert_allclose(one.stiffness, other.stiffness, rtol=1e-7, atol=1e-3)


@pytest.mark.parametrize("name", ["over-actuated", "gantry", "arm of axes", "hybrid", "springs outside"])
def test_random_machines_agree_with_bodies_in_space(name: str) -> None:
    task = Classes(4).task(name)
    element, legs = get("joint_coupling").places(task.description)[0]
    real = sm.Machine(task.description).with_effect(
        "joint_coupling", element=element, legs=list(legs) or None, per_turn=PER_TURN
    )
    truth, found = checks(replace(task, description=real.description))
    assert truth.found and len(found) >= 2
    assert not [c.wrong for c in found if c.wrong]


def test_a_motor_does_not_read_what_its_joint_moves_with_another() -> None:
    machine = sm.load_machine("tripteron")
    real = machine.with_effect("joint_coupling", element="actuator.proximal", legs=["2"], per_turn=0.005)
    p = machine.description.home.p + RNG.uniform(-0.05, 0.05, (3, 3))
    i, home = machine.compiled.names.joints["2.proximal"], machine.compiled.home_coordinates()
    turned = sm.inverse_kinematics(machine, p).coordinates
    expected = 0.005 * (turned[:, i] - home[i]) / (2 * np.pi)
    assert np.abs(expected).max() > 1e-6
    np.testing.assert_allclose(error_in_python(real, "2.actuator", turned), expected, rtol=1e-12)
    np.testing.assert_array_equal(error_in_python(real, "1.actuator", turned), 0.0)


def test_a_screw_that_turns_with_its_spline_rises_by_its_lead(tmp_path: Path) -> None:
    (tmp_path / "scara.yaml").write_text(SCARA)
    scara = sm.load_machine(tmp_path / "scara.yaml")
    real = scara.with_effect("joint_coupling", element="j3.j4", per_turn=0.016)
    drives = np.array([[0.3, 0.5, np.pi, 0.0], [0.3, 0.5, -np.pi / 2, 0.01]])
    order = [scara.actuators.index(f"arm.{j}") for j in ("j1", "j2", "j4", "j3")]
    commanded = np.zeros_like(drives)
    commanded[:, order] = drives
    rises = real.solve_joints(commanded).displacement
    np.testing.assert_allclose(rises[:, 2], [0.008, -0.004], atol=1e-12)
    np.testing.assert_allclose(rises[:, [0, 1, 3, 4, 5]], 0.0, atol=1e-12)
    real.save(tmp_path / "real.yaml")
    assert sm.load_machine(tmp_path / "real.yaml") == real


def test_what_is_tried_in_a_diagnosis() -> None:
    effect = get("joint_coupling")
    assert effect.tried is not None
    tried = [element for element, _ in effect.tried(ARM.description)]
    joints = [a.split(".")[1] for a in ARM.actuators]
    assert tried == [f"{b}.{a}" for a, b in pairwise(joints)]
    carriages = effect.tried(sm.load_machine("tripteron").description)
    assert carriages == [("actuator.proximal", (leg,)) for leg in "123"] + [
        ("actuator.proximal", tuple("123"))
    ]
    for name in ("hexapod", "orthoglide-revised", "linear-delta", "five-bar"):
        assert effect.tried(sm.load_machine(name).description) == []


def pendant(tmp_path: Path, more: str = "coupled: {j1: 1}") -> Path:
    path = tmp_path / "pendant.yaml"
    path.write_text(SCARA.replace("{actuator: j2, kind", f"{{actuator: j2, {more}, kind"))
    return path


def test_a_pendant_that_shows_the_angle_against_the_base(tmp_path: Path) -> None:
    (tmp_path / "scara.yaml").write_text(SCARA)
    plain, shown = sm.load_machine(tmp_path / "scara.yaml"), sm.load_machine(pendant(tmp_path))
    joints = RNG.uniform(-1, 1, (4, 4))
    by = {a: k for k, a in enumerate(plain.actuators)}
    seen = joints.copy()
    seen[:, by["arm.j2"]] -= joints[:, by["arm.j1"]]
    one, other = sm.forward_kinematics(plain, joints), sm.forward_kinematics(shown, seen)
    np.testing.assert_allclose(one.position, other.position, atol=1e-12)
    np.testing.assert_allclose(other.actuators, seen, atol=1e-12)
    back = sm.inverse_kinematics(shown, one.position, one.rotation, start=other.coordinates)
    np.testing.assert_allclose(back.actuators, seen, atol=1e-9)
    assert np.abs(shown.solve_joints(seen).displacement).max() < 1e-12  # the controller knows
    shown.save(tmp_path / "again.yaml")
    assert sm.load_machine(tmp_path / "again.yaml") == shown


def test_a_cell_with_such_a_pendant_is_simulated_compensated_and_saved(tmp_path: Path) -> None:
    shown = sm.load_machine(pendant(tmp_path))
    joints = RNG.uniform(-0.5, 0.5, (6, 4))
    joints[:, shown.actuators.index("arm.j3")] *= 0.1
    at = sm.forward_kinematics(shown, joints)
    real = shown.with_effect("joint_coupling", element="j3.j4", per_turn=0.016)
    found = sm.compensate(real, actuators=at.actuators)
    j3, j4 = (real.actuators.index(f"arm.{j}") for j in ("j3", "j4"))
    moved = found.actuators - at.actuators
    np.testing.assert_allclose(moved[:, j3], -0.016 * at.actuators[:, j4] / (2 * np.pi), atol=1e-7)
    np.testing.assert_allclose(np.delete(moved, j3, axis=1), 0.0, atol=1e-7)


@pytest.mark.parametrize("other", ["j2", "j3", "elbow"])
def test_a_relation_that_cannot_be_is_refused_with_its_place(tmp_path: Path, other: str) -> None:
    path = pendant(tmp_path, f"coupled: {{{other}: 1}}")
    with pytest.raises(sm.StiffmapError, match=rf"pendant\.yaml.*coupled.*found '{other}'"):
        sm.load_machine(path)
