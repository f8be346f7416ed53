"""Orientations that an instrument saw are read in the way in which they follow the commanded joints."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import stiffmap as sm
from stiffmap.experiment.channels import AXES
from stiffmap.ui.cli.app import main

DH = ((0.0, 120.0, 0.0, 90.0), (0.0, 0.0, -430.0, 0.0), (0.0, 0.0, -390.0, 0.0), (0.0, 110.0, 0.0, 90.0),
      (0.0, 95.0, 0.0, -90.0), (0.0, 80.0, 0.0, 0.0))  # fmt: skip
JOINTS = np.random.default_rng(5).uniform(-80, 80, (14, 6)).round(2)


def seen(noise: float = 0.0) -> Rotation:
    """What an instrument sees: its own turn, the joints' by hand, that of a target on the tool, an error of rad."""
    out = Rotation.from_rotvec(np.tile([0.4, -1.1, 2.0], (len(JOINTS), 1)))
    for (zero, _, _, alpha), q in zip(DH, JOINTS.T, strict=True):
        out = (
            out
            * Rotation.from_euler("z", (zero + q)[:, None], degrees=True)
            * Rotation.from_euler("x", [[alpha]], degrees=True)
        )
    error = Rotation.from_rotvec(noise * np.random.default_rng(6).normal(size=(len(JOINTS), 3)))
    return out * Rotation.from_euler("xyz", [25, -40, 60], degrees=True) * error


def experiment(folder: Path, heads: str, cells: np.ndarray, *more: str) -> sm.Experiment:
    """Of a sheet with joints, places and numbers of an orientation."""
    rows = [f"{','.join(map(str, q))},{100 + k},{200 - k},300,{','.join(map(repr, c.tolist()))}"
            for k, (q, c) in enumerate(zip(JOINTS, cells, strict=True))]  # fmt: skip
    text = f"J1,J2,J3,J4,J5,J6,X meas [mm],Y meas [mm],Z meas [mm],{heads}\n" + "\n".join(rows) + "\n"
    (folder / "sheet.csv").write_text(text)
    lines = "\n".join(",".join(map(str, row)) for row in DH)
    (folder / "dh.csv").write_text(f"theta [deg],d [mm],a [mm],alpha [deg]\n{lines}\n")
    noise = [o for a in ("dx", "dy", "dz", "rx", "ry", "rz") for o in ("--noise", f"{a}=0.01")]
    files = [
        str(folder / "sheet.csv"),
        "--dh",
        str(folder / "dh.csv"),
        "--unit",
        "joints=deg",
        "-o",
        str(folder / "e"),
    ]
    assert main(["experiment", "new", *files, *noise, *more]) == 0
    return sm.load_experiment(folder / "e")


@pytest.mark.parametrize("turns", ["xyz", "XYZ", "zyx", "ZYX", "ZYZ", "zyz", "rotvec"])
@pytest.mark.parametrize("heads", ["rx [deg],ry [deg],rz [deg]", "A,B,C", "Roll [deg],Pitch [deg],Yaw [deg]"])
def test_three_angles_turn_as_the_joints_do(
    turns: str, heads: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    true = seen(0.002)
    cells = true.as_rotvec(degrees=True) if turns == "rotvec" else true.as_euler(turns, degrees=True)
    e = experiment(tmp_path, heads, cells)
    assert e.seen_rotation is not None
    np.testing.assert_allclose(e.seen_rotation, true.as_matrix(), atol=1e-9)
    named = {"rx": "rotvec", "A,": "ZYX", "Ro": "xyz"}[heads[:2]]
    assert ("as the joints show" in capsys.readouterr().out) == (turns != named)


@pytest.mark.parametrize("by_columns", [False, True])
@pytest.mark.parametrize("joints", [True, False])
def test_poses_are_homogeneous_matrices_too(by_columns: bool, joints: bool, tmp_path: Path) -> None:
    """Next to commanded joints an instrument saw them; alone they are what was commanded."""
    matrices = np.tile(np.eye(4), (len(JOINTS), 1, 1))
    matrices[:, :3, :3] = seen().as_matrix()
    matrices[:, :3, 3] = np.random.default_rng(7).uniform(0.2, 0.6, (len(JOINTS), 3))
    cells = np.swapaxes(matrices, 1, 2) if by_columns else matrices
    heads = (
        [f"O_T_EE_{k}" for k in range(16)] if by_columns else [f"T{i}{j}" for i in range(4) for j in range(4)]
    )
    more = JOINTS if joints else np.tile([0.1, 50.0], (len(JOINTS), 1))
    heads += [f"J{k} [deg]" for k in range(1, 7)] if joints else ["dz [mm]", "fz [N]"]
    rows = np.hstack([cells.reshape(-1, 16), more])
    np.savetxt(tmp_path / "sheet.csv", rows, delimiter=",", header=",".join(heads), comments="")
    made = ["experiment", "new", str(tmp_path / "sheet.csv"), "--machine", "ur10", "-o", str(tmp_path / "e")]
    made += [o for a in AXES for o in ("--noise", f"{a}=0.01") if joints or a == "dz"]
    if joints:  # a controller writes such places too
        assert main([*made, "--unit", "length=m"]) == 2
        at = (12, 13, 14) if by_columns else (3, 7, 11)
        made += [o for a, k in zip("xyz", at, strict=True) for o in ("--map", f"p{a}={heads[k]}")]
    assert main([*made, "--unit", "length=m"]) == 0
    e = sm.load_experiment(tmp_path / "e")
    turned, places = (e.seen_rotation, e.seen) if joints else (e.rotation, e.position)
    assert turned is not None and places is not None
    np.testing.assert_allclose(turned, matrices[:, :3, :3], atol=1e-9)
    np.testing.assert_allclose(places, matrices[:, :3, 3], atol=1e-9)


def test_every_setup_has_a_frame_of_its_own(tmp_path: Path) -> None:
    moved = Rotation.from_rotvec(np.outer(np.arange(len(JOINTS)) % 2, [0.3, 0.8, -0.5]))
    true = moved * seen()
    setups = np.arange(len(JOINTS))[:, None] % 2 + 1
    e = experiment(
        tmp_path, "rx [deg],ry [deg],rz [deg],setup", np.hstack([true.as_euler("xyz", degrees=True), setups])
    )
    assert e.seen_rotation is not None
    np.testing.assert_allclose(e.seen_rotation, true.as_matrix(), atol=1e-9)


@pytest.mark.parametrize("heads", ["Q0,Q1,Q2,Q3", "Q1,Q2,Q3,Q4", "qw,qx,qy,qz"])
@pytest.mark.parametrize("last", [True, False])
def test_numbered_quaternions_turn_as_the_joints_do(heads: str, last: bool, tmp_path: Path) -> None:
    """Names say the order of w, x, y, z; numbers do not."""
    first = seen().as_quat()[:, [3, 0, 1, 2]]
    e = experiment(tmp_path, heads, first[:, [1, 2, 3, 0]] if last and heads[1] != "w" else first)
    assert e.seen_rotation is not None
    np.testing.assert_allclose(e.seen_rotation, seen().as_matrix(), atol=1e-9)


@pytest.mark.parametrize("heads", ["rx [deg],ry [deg],rz [deg]", "Q0,Q1,Q2,Q3"])
def test_joints_that_turn_otherwise_are_said(
    heads: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cells = seen().as_quat()[:, [3, 0, 1, 2]] if heads[0] == "Q" else seen().as_rotvec(degrees=True)
    experiment(tmp_path, heads, cells, "--dh-convention", "modified")
    assert "do not turn as the joints of the machine do" in capsys.readouterr().out


def test_a_machine_of_another_convention_is_no_case_for_a_diagnosis(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The places are those of the arm, read by hand from its transformations; the table is then taken in the other convention."""
    at = []
    for q in JOINTS:
        p, r = np.zeros(3), Rotation.identity()
        for (zero, d, a, alpha), angle in zip(DH, q, strict=True):
            r = r * Rotation.from_euler("z", zero + angle, degrees=True)
            p, r = p + r.apply([a, 0, d]), r * Rotation.from_euler("x", alpha, degrees=True)
        at.append(p + r.apply([10, 20, 30]))
    e = experiment(tmp_path, "px [mm],py [mm],pz [mm]", np.array(at), "--map", "note=X meas|Y meas|Z meas")
    assert np.nanmax(np.abs(sm.residual(tmp_path / "e/machine.yaml", e).values)) < 1e-6
    modified = ["--dh-convention", "modified", "-o", str(tmp_path / "other.yaml")]
    assert main(["import", str(tmp_path / "dh.csv"), *modified]) == 0
    limits = sm.residual(tmp_path / "other.yaml", e).limitations
    assert "the places read do not follow the commands" in limits[0]
    for call in (sm.diagnose, sm.calibrate):
        with pytest.raises(sm.StiffmapError, match="look first at the machine's geometry"):
            call(tmp_path / "other.yaml", e)


def test_angles_that_are_no_rotation_vector_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of 45, -71 and -166 deg the length is 186 deg; where no joints say how they turn, the table must."""
    poses = tmp_path / "poses.csv"
    poses.write_text("x [mm],y [mm],z [mm],rx [deg],ry [deg],rz [deg]\n400,10,500,45,-71,-166\n")
    assert main(["solve", "ur10", "--at", str(poses)]) == 2
    err = capsys.readouterr().err
    assert "poses.csv, line 1: rx [deg]: a rotation vector is at most 180 deg long, found 186 deg" in err
    assert main(["solve", "ur10", "--at", str(poses), "--map", "roll=rx", "--map", "pitch=ry", "--map", "yaw=rz"]) in (0, 1)  # fmt: skip
    sheet = tmp_path / "sheet.csv"
    sheet.write_text(
        "x [mm],y [mm],z [mm],px [mm],py [mm],pz [mm],rx [deg],ry [deg],rz [deg]\n400,10,500,1,2,3,45,-71,-166\n"
    )
    noise = [o for a in ("dx", "dy", "dz", "rx", "ry", "rz") for o in ("--noise", f"{a}=0.01")]
    assert (
        main(["experiment", "new", str(sheet), "--machine", "ur10", *noise, "-o", str(tmp_path / "e")]) == 2
    )
    assert "a rotation vector is at most 180 deg long" in capsys.readouterr().err


def test_a_unit_of_joints_is_for_those_without_one(tmp_path: Path) -> None:
    """In the header of one joint stands rad; the others are in degrees, as is said of all without one."""
    e = experiment(tmp_path, "rx [deg],ry [deg],rz [deg]", seen().as_rotvec(degrees=True))
    sheet = tmp_path / "sheet.csv"
    lines = [line.split(",") for line in sheet.read_text().splitlines()]
    cells = [["J1 [rad]", *lines[0][1:]]] + [
        [repr(float(np.radians(float(c[0])))), *c[1:]] for c in lines[1:]
    ]
    sheet.write_text("\n".join(",".join(c) for c in cells) + "\n")
    files = [str(sheet), "--dh", str(tmp_path / "dh.csv"), "--unit", "joints=deg", "--noise", "dx=1"]
    assert main(["experiment", "new", *files, "-o", str(tmp_path / "rad")]) == 0
    assert e.command is not None
    np.testing.assert_allclose(sm.load_experiment(tmp_path / "rad").command, e.command, atol=1e-12)


@pytest.mark.parametrize(
    ("heads", "numbers"),
    [
        ("RX [rad],RY [rad],RZ [rad]", lambda r: r.as_rotvec()),
        ("A,B,C", lambda r: r.as_euler("ZYX", degrees=True)),
        ("Roll [deg],Pitch [deg],Yaw [deg]", lambda r: r.as_euler("xyz", degrees=True)),
        ("qw,qx,qy,qz", lambda r: r.as_quat()[:, [3, 0, 1, 2]]),
        ("r11,r12,r13,r21,r22,r23,r31,r32,r33", lambda r: r.as_matrix().reshape(-1, 9)),
    ],
)
@pytest.mark.parametrize("asked", [True, False])
def test_a_target_off_the_tool_was_seen_next_to_commanded_poses(
    heads: str, numbers: Callable[[Rotation], np.ndarray], asked: bool, tmp_path: Path
) -> None:
    turned = Rotation.from_euler("xyz", np.random.default_rng(2).uniform(-60, 60, (15, 3)), degrees=True)
    commanded = np.random.default_rng(3).uniform([500, -300, 200], [800, 300, 600], (15, 3))
    spot = commanded + turned.apply([50, 10, 120])
    places = Rotation.from_rotvec([0.1, 0.02, 2.0]).apply(spot) + [1500, 200, -300]
    cells = np.hstack([commanded, numbers(turned), places])
    head = f"X [mm],Y [mm],Z [mm],{heads},X meas [mm],Y meas [mm],Z meas [mm]"
    rows = "\n".join(",".join(f"{v:.9f}" for v in row) for row in cells)
    file = tmp_path / "sheet.csv"
    file.write_text(f"{head}\n{rows}\n")
    columns = {f"p{a.lower()}": f"{a} meas" for a in "XYZ"} if asked else {}
    instrument = None if asked else "tracker"
    made = sm.experiment_from_table("ur10", file, tmp_path / "e", columns=columns, instrument=instrument)
    e = made.experiment
    assert (e.frame, e.tool) == ("unknown", "unknown")
    assert e.seen == pytest.approx(1e-3 * places, abs=1e-9)
    assert e.rotation == pytest.approx(turned.as_matrix(), abs=1e-6)


def test_differences_of_a_target_off_the_tool_are_turned_into_base_axes(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    turned = Rotation.from_euler("xyz", rng.uniform(-60, 60, (15, 3)), degrees=True)
    commanded = rng.uniform([500, -300, 200], [800, 300, 600], (15, 3))
    frame = Rotation.from_rotvec([0.1, 0.02, 2.0])
    unloaded = frame.apply(commanded + turned.apply([50, 10, 120])) + [1500, 200, -300]
    moved = rng.normal([0, 0, -0.3], 0.02, (15, 3))
    cells = np.hstack([commanded, turned.as_rotvec(), unloaded, unloaded + frame.apply(moved)])
    places = [f"{a} {what} [mm]" for what in ("unloaded", "loaded") for a in "XYZ"]
    head = ",".join(["X [mm]", "Y [mm]", "Z [mm]", "RX [rad]", "RY [rad]", "RZ [rad]", *places])
    rows = "\n".join(",".join(f"{v:.9f}" for v in row) for row in cells)
    file = tmp_path / "sheet.csv"
    file.write_text(f"{head}\n{rows}\n")
    made = sm.experiment_from_table("ur10", file, tmp_path / "e", constants={"fz": -100.0})
    assert made.experiment.reading[:, :3] == pytest.approx(1e-3 * moved, abs=1e-8)
