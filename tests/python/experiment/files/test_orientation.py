"""Orientations of data.csv: against home, in every form, on a machine whose home is turned."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import stiffmap as sm
from stiffmap.common.errors import StiffmapError
from stiffmap.experiment import Experiment, Predictor, save_experiment

HEAD = """machine: ur10
quantity: position
units: {length: mm, angle: deg}
noise: {dx: 0.01, dy: 0.01, dz: 0.01}
"""
POSE = "-800,100,300"
TURN = Rotation.from_rotvec(np.radians([10.0, -5.0, 20.0]))


@pytest.fixture(scope="module")
def arm() -> sm.Machine:
    return sm.load_machine("ur10")


def written(folder: Path, columns: str, cells: str, more: str = "") -> Experiment:
    (folder / "experiment.yaml").write_text(HEAD + more)
    (folder / "data.csv").write_text(f"x,y,z,{columns},dx,dy,dz\n{POSE},{cells},0,0,0\n")
    return sm.load_experiment(folder)


def text(values: object) -> str:
    return ",".join(f"{v:.12g}" for v in np.ravel(values))  # type: ignore[call-overload]


def test_no_turn_is_home(tmp_path: Path, arm: sm.Machine) -> None:
    home = arm.description.home.r
    assert np.abs(home - np.eye(3)).max() > 0.5  # else this test says nothing
    e = Predictor(arm, written(tmp_path, "rotx,roty,rotz", "0,0,0")).experiment
    assert e.rotation is not None
    assert e.rotation[0] == pytest.approx(home, abs=1e-15)


def forms() -> dict[str, tuple[str, str, str]]:
    quaternion = TURN.as_quat()[[3, 0, 1, 2]]
    matrix = ",".join(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))
    moving = TURN.as_euler("XYZ", degrees=True)
    fixed = TURN.as_euler("zyx", degrees=True)
    return {
        "vector": ("rotx,roty,rotz", text(np.degrees(TURN.as_rotvec())), ""),
        "quaternion": ("qw,qx,qy,qz", text(quaternion), ""),
        "minus the quaternion": ("qw,qx,qy,qz", text(-quaternion), ""),
        "turning axes": ("euler1,euler2,euler3", text(moving), "orientation: {euler: XYZ}\n"),
        "fixed axes": ("euler1,euler2,euler3", text(fixed), "orientation: {euler: zyx}\n"),
        "matrix": (matrix, text(TURN.as_matrix()), ""),
    }


@pytest.mark.parametrize("form", forms())
def test_every_form_is_the_same_pose(tmp_path: Path, arm: sm.Machine, form: str) -> None:
    e = Predictor(arm, written(tmp_path, *forms()[form])).experiment
    assert e.rotation is not None
    assert e.rotation[0] == pytest.approx(TURN.as_matrix() @ arm.description.home.r, abs=1e-9)


def test_euler_angles_by_hand(tmp_path: Path, arm: sm.Machine) -> None:
    """XYZ is Rx · Ry · Rz: x stays where the first turn leaves it."""
    a, b = np.radians(30.0), np.radians(40.0)
    e = written(tmp_path, "euler1,euler2,euler3", "30,40,0", "orientation: {euler: XYZ, against: base}\n")
    rx = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    ry = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    assert e.rotation is not None
    assert e.rotation[0] == pytest.approx(rx @ ry, abs=1e-12)


def test_against_base_is_the_tool_itself(tmp_path: Path, arm: sm.Machine) -> None:
    tool = TURN.as_matrix() @ arm.description.home.r
    vector = text(np.degrees(Rotation.from_matrix(tool).as_rotvec()))
    e = written(tmp_path, "rotx,roty,rotz", vector, "orientation: {against: base}\n")
    assert Predictor(arm, e).experiment.rotation == pytest.approx(tool[None], abs=1e-9)


def test_a_turned_home_end_to_end(tmp_path: Path, arm: sm.Machine) -> None:
    """A tool point off by d along the tool moves every reading by R d, R = turn · home."""
    off = np.array([0.0, 0.0, 1e-3])
    moved = TURN.as_matrix() @ arm.description.home.r @ off
    reading = text(1e3 * moved)
    (tmp_path / "experiment.yaml").write_text(HEAD)
    cells = f"{POSE},{text(np.degrees(TURN.as_rotvec()))},{reading}"
    (tmp_path / "data.csv").write_text(f"x,y,z,rotx,roty,rotz,dx,dy,dz\n{cells}\n")
    longer = arm.with_effect("tcp_offset", error_z=1e-3)
    data = sm.load_experiment(tmp_path)
    assert Predictor(longer, data)()[0, :3] == pytest.approx(data.reading[0, :3], abs=1e-8)


def test_saved_and_read_back(tmp_path: Path, arm: sm.Machine) -> None:
    e = written(tmp_path, *forms()["vector"])
    for i, saved in enumerate((e, Predictor(arm, e).experiment)):
        save_experiment(saved, tmp_path / str(i))
        back = Predictor(arm, sm.load_experiment(tmp_path / str(i))).experiment
        assert back.rotation == pytest.approx(Predictor(arm, e).experiment.rotation, abs=1e-8)


@pytest.mark.parametrize(
    ("columns", "cells", "words"),
    [
        ("qw,qx,qy,qz", "1,1,0,0", "length 1"),
        ("euler1,euler2,euler3", "1,2,3", "convention"),
        ("r11,r12,r13,r21,r22,r23,r31,r32,r33", "1,0,0,0,1,0,0,0,-1", "rotation matrix"),
        ("rotx,qw,qx,qy,qz", "0,1,0,0,0", "given twice"),
    ],
)
def test_bad_orientations(tmp_path: Path, columns: str, cells: str, words: str) -> None:
    with pytest.raises(StiffmapError, match=words):
        written(tmp_path, columns, cells)


def test_commands_in_another_branch_are_solved_there(tmp_path: Path, arm: sm.Machine) -> None:
    """Elbow down stands for a pose that is reached from home elbow up."""
    joints = ("base", "shoulder", "elbow", "wrist_1", "wrist_2", "wrist_3")
    command = "".join(f"  c{i}: {{actuator: arm.{j}, unit: deg}}\n" for i, j in enumerate(joints))
    (tmp_path / "experiment.yaml").write_text(HEAD + "command:\n" + command)
    rows = ["1,0,-60,90,-120,-90,0,0,0,0", "down,0,25.6,-90,-25.6,-90,0,0,0,0"]
    header = "id," + ",".join(f"c{i}" for i in range(6)) + ",dx,dy,dz"
    (tmp_path / "data.csv").write_text("\n".join([header, *rows]) + "\n")
    e = Predictor(arm, sm.load_experiment(tmp_path)).experiment
    assert e.joints is not None
    assert e.joints[1] == pytest.approx(np.radians([0, 25.6, -90, -25.6, -90, 0]))
