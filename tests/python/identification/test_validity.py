"""Beyond what the readings of a calibration covered nothing vouches for its numbers, and every command says so."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.python.experiment.virtual.joint_plans import plan_of_joints

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor, save_experiment
from stiffmap.identification.validity import beyond, covered
from stiffmap.machining.compensation import compensate
from stiffmap.solve.validity import KEY, Validity
from stiffmap.ui.cli.app import main

FORCE = np.array([0.0, 0.0, -50.0, 0.0, 0.0, 0.0])


def plan_at(centre: float, seed: int) -> Experiment:
    """Poses of an arm about one place of its first joint, under a load."""
    q = np.radians([centre, -60, 90, -120, -90, 0]) + np.random.default_rng(seed).uniform(-0.3, 0.3, (12, 6))
    plan = plan_of_joints(sm.load_machine("ur10"), q, noise=1e-5)
    return replace(plan, wrench=np.tile(FORCE, (12, 1)) * np.linspace(0.0, 1.0, 12)[:, None])


@pytest.fixture(scope="module")
def near() -> sm.Machine:
    machine = sm.load_machine("ur10")
    e = plan_at(0.0, 1)
    valid = covered(machine, e, np.ones(len(e), bool))
    return replace(valid, error=5e-5, error_u=4e-6).kept_by(machine)


def test_the_region_survives_its_file(near: sm.Machine, tmp_path: Path) -> None:
    near.save(tmp_path / "machine.yaml")
    again = sm.load_machine(tmp_path / "machine.yaml")
    said = Validity.of_machine(again)
    assert said is not None
    assert said == Validity.of_machine(near)
    assert (said.poses, said.error, said.loads) == (12, 5e-5, {"fz": (-50.0, 0.0)})
    low, high = said.drives["arm.base"]
    q = plan_at(0.0, 1).joints
    assert q is not None
    assert (low, high) == (pytest.approx(q[:, 0].min()), pytest.approx(q[:, 0].max()))
    with_effect = again.with_effect("zero_offset", element="elbow", error=1e-4)
    assert Validity.of_machine(with_effect) == said


def test_a_broken_region_is_one_clear_error() -> None:
    machine = sm.load_machine("ur10")
    for wrong in ((("poses", "many"),), (("poses", 3), ("loads", (("up", (0.0, 1.0)),))), 7):
        broken = sm.Machine(replace(machine.description, extra=((KEY, wrong),)))
        with pytest.raises(sm.StiffmapError, match="expected poses, and ranges"):
            Validity.of_machine(broken)
    assert Validity.of_machine(machine) is None


def test_other_corners_loads_and_temperatures_are_beyond(near: sm.Machine) -> None:
    inside, other = plan_at(0.0, 1), plan_at(90.0, 2)
    far = beyond(near, inside)
    assert far is not None and not far.any()
    far = beyond(near, other)
    assert far is not None and far.all()
    pulled = replace(inside, wrench=-inside.wrench)
    far = beyond(near, pulled)
    assert far is not None and far.sum() == 11  # all but the row without a load
    valid = Validity.of_machine(near)
    assert valid is not None
    warm = replace(valid, temperature=(20.0, 22.0)).kept_by(near)
    far = beyond(warm, replace(inside, temperature=np.linspace(20.0, 24.0, 12)))
    assert far is not None and list(far) == [False] * 6 + [True] * 6
    assert beyond(sm.load_machine("ur10"), other) is None


def test_compensation_marks_rows_and_check_says_worse(
    near: sm.Machine, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One corner was read; a number that is right there by chance enlarges the error of the other corner."""
    wrong = near.with_effect("zero_offset", element="elbow", error=3e-4)
    wrong.save(tmp_path / "machine.yaml")
    other = replace(plan_at(90.0, 2), wrench=np.zeros((12, 6)))
    declared = sm.load_machine("ur10")
    save_experiment(other.with_readings(Predictor(declared, other)()), tmp_path / "other")
    arguments = ["compensate", str(tmp_path / "machine.yaml"), "--check", str(tmp_path / "other"), "--json"]
    assert main(arguments) == 1
    said = json.loads(capsys.readouterr().out)
    assert said["verdict"].startswith("worse")
    assert said["rows beyond what the machine was calibrated by"] == "12 of 12"
    assert said["promised by the file, mm"].startswith("0.050 ± 0.004 rms")
    q = np.vstack([plan_at(0.0, 1).joints, other.joints])  # type: ignore[list-item]
    found = compensate(wrong, actuators=q, wrench=FORCE / 2)
    assert found.beyond is not None and list(found.beyond) == [False] * 12 + [True] * 12
    found.write(tmp_path / "commands.csv")
    table = np.genfromtxt(tmp_path / "commands.csv", delimiter=",", names=True)
    assert list(table["beyond_calibration"]) == [0.0] * 12 + [1.0] * 12


def test_maps_mark_poses_and_loads(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    machine = sm.load_machine("orthoglide-revised")
    grid = np.linspace(-0.1, 0.1, 5)
    at = dict.fromkeys("xyz", grid)
    assert "beyond_calibration" not in sm.error_map(machine, x=grid, y=0.0, z=0.0, wrench=[1, 0, 0, 0, 0, 0])
    space = np.stack(np.meshgrid(grid, grid, grid, indexing="ij"), -1)[..., ::-1]
    u = sm.inverse_kinematics(machine, space).actuators
    half = {n: (float(u[..., i].min()), float(np.median(u[..., i]))) for i, n in enumerate(machine.actuators)}
    known = Validity(8, half, loads={"fx": (0.0, 100.0)}).kept_by(machine)
    loads = {"small": [50.0, 0, 0, 0, 0, 0], "large": [300.0, 0, 0, 0, 0, 0]}
    ds = sm.error_map(known, **at, wrench=loads, plane=None)
    assert ds.beyond_calibration.sel(case="large").all()
    small = ds.beyond_calibration.sel(case="small").values
    expected = np.zeros(small.shape, bool)
    for i, (low, high) in enumerate(half.values()):
        expected |= u[..., i] > high + 0.05 * (high - low)
    assert 0 < expected.sum() < expected.size
    assert np.array_equal(small, expected)
    known.save(tmp_path / "machine.yaml")
    arguments = [
        "map",
        str(tmp_path / "machine.yaml"),
        "--points",
        "3",
        "--z",
        "0",
        "-o",
        str(tmp_path / "map"),
    ]
    assert main([*arguments, "--no-pictures"]) == 0
    assert "beyond what the machine was calibrated by (8 poses" in capsys.readouterr().out
