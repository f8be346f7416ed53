"""What instruments write, through the mapping files that ship."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.spreadsheet.instrument import instrument_names, load_instrument
from stiffmap.ui.cli import main

TRACKER = """Point ID;X Nominal;Y Nominal;Z Nominal;X [mm];Y [mm];Z [mm];Temp
A1;0,0;400,0;0,0;0,012;399,980;0,004;20,1
A2;50,0;420,0;0,0;50,031;419,991;-0,002;20,2
"""
GAUGES = """nr,x,y,z,Fx,gauge x,gauge y [mm]
1,0,400,0,50,351,0.012
2,0,400,0,-50,-349,-0.011
"""
BALL_BAR = """angle,radial
0,1.5
90,-2.0
180,0.25
"""
CYCLES = """pose,cycle,x cmd,y cmd,z cmd,x,y,z
P1,1,0,400,0,0.010,400.002,0
P1,2,0,400,0,0.012,400.001,0
P2,1,50,420,0,50.003,419.990,0
P2,2,50,420,0,50.005,419.992,0
"""


def made(tmp_path: Path, instrument: str, text: str, *more: str) -> sm.Experiment:
    (tmp_path / "file.csv").write_text(text, encoding="utf-8")
    call = [
        "experiment",
        "new",
        str(tmp_path / "file.csv"),
        "--machine",
        "five-bar",
        "--instrument",
        instrument,
    ]
    assert main([*call, "-o", str(tmp_path / "out"), *more]) == 0
    return sm.load_experiment(tmp_path / "out")


def test_a_tracker_lists_points(tmp_path: Path) -> None:
    e = made(tmp_path, "tracker", TRACKER, "--noise", "dx=0.01", "--noise", "dy=0.01", "--noise", "dz=0.01")
    assert e.quantity == "position"
    np.testing.assert_allclose(e.position, [[0, 0.4, 0], [0.05, 0.42, 0]])
    np.testing.assert_allclose(e.reading[:, :3], 1e-6 * np.array([[12, -20, 4], [31, -9, -2]]), atol=1e-12)
    assert e.ids == ("A1", "A2")


@pytest.mark.parametrize(
    "header", ["X;Y;Z;X meas;Y meas;Z meas", "X soll;Y soll;Z soll;X Mess;Y Mess;Z Mess"]
)
def test_plain_axes_next_to_measured_ones_are_commanded(header: str, tmp_path: Path) -> None:
    text = f"{header}\n0;400;0;0,012;399,980;0,004\n50;420;0;50,031;419,991;-0,002\n"
    e = made(tmp_path, "tracker", text, "--noise", "dx=0.01", "--noise", "dy=0.01", "--noise", "dz=0.01")
    np.testing.assert_allclose(e.position, [[0, 0.4, 0], [0.05, 0.42, 0]])
    np.testing.assert_allclose(e.reading[:, :2], [[0.012e-3, -0.020e-3], [0.031e-3, -0.009e-3]], atol=1e-12)


def test_places_without_a_command_are_asked_for(tmp_path: Path) -> None:
    (tmp_path / "file.csv").write_text("X,Y,Z,Xm,Ym,Zm\n0,400,0,0,400,0\n0,420,0,0,420,0\n", encoding="utf-8")
    with pytest.raises(StiffmapError, match=r"found 'X' alone: say --map x='HEADER' .*--map px='HEADER'"):
        sm.experiment_from_table("hexapod", tmp_path / "file.csv", tmp_path / "out", instrument="tracker")


def test_titles_in_the_middle_of_what_they_mean(tmp_path: Path) -> None:
    text = (
        "Name,,Nominal,,,Actual,,,Deviation,\n,X,Y,Z,X,Y,Z,X,Y,Z\n,mm,mm,mm,mm,mm,mm,mm,mm,mm\n"
        "P1,0,400,0,0.1,400.02,0,0.1,0.02,0\nP2,50,400,0,50.12,400.01,0,0.12,0.01,0\n"
    )
    e = made(tmp_path, "tracker", text, "--noise", "dx=0.01", "--noise", "dy=0.01", "--noise", "dz=0.01")
    np.testing.assert_allclose(e.position, [[0, 0.4, 0], [0.05, 0.4, 0]])
    np.testing.assert_allclose(e.reading[:, :3], 1e-6 * np.array([[100, 20, 0], [120, 10, 0]]), atol=1e-12)
    assert e.ids == ("P1", "P2")


INCHES = """Name,X nominal,Y nominal,Z nominal,X actual,Y actual,Z actual
P1,0,15,0,0.001,15.002,0
P2,2,15,0,2.001,15.001,0
"""


@pytest.mark.parametrize(
    "head",
    [
        "Units: Inches\nDate: 2024-01-01\n",
        "# Length units = inches\n# Frame: World\n",
        "Length Unit,Inches,Angle Unit,Degrees\nDate: 2024,,,\n",
        "Units: in/deg\n" + "".join(f"Remark {k}: none\n" for k in range(9)),
    ],
)
def test_a_line_above_the_table_says_the_unit_of_all_lengths(
    head: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sure = ["--noise", "dx=0.01", "--noise", "dy=0.01", "--noise", "dz=0.01"]
    e = made(tmp_path, "tracker", head + INCHES, *sure)
    np.testing.assert_allclose(e.position, [[0, 0.381, 0], [0.0508, 0.381, 0]])
    np.testing.assert_allclose(e.reading[:, 0], 25.4e-6, rtol=1e-9)
    assert "as a line above the table says" in capsys.readouterr().out


def test_a_unit_above_the_table_that_nobody_knows(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file.csv").write_text("Units: Feet\nDate: 2024-01-01\n" + INCHES)
    call = ["experiment", "new", str(tmp_path / "file.csv"), "--machine", "five-bar", "--instrument"]
    assert main([*call, "tracker", "-o", str(tmp_path / "out")]) == 2
    assert "the unit 'Feet' is not known" in capsys.readouterr().err


def test_moments_of_a_load_cell(tmp_path: Path) -> None:
    rows = "x [mm],y [mm],Fx/N,Fy/N,Tx/Nm,Ty/Nm,Tz/Nm,dx/µm\n0,400,110,0,1,2,3,12\n50,400,110,0,1,2,3,14\n"
    (tmp_path / "cell.csv").write_text(rows, encoding="utf-8")
    found = sm.experiment_from_table(
        "five-bar", tmp_path / "cell.csv", tmp_path / "out", constants={"z": 0.0}, noise={"dx": 1.0}
    )
    np.testing.assert_allclose(found.experiment.wrench, [[110, 0, 0, 1, 2, 3]] * 2)


def test_dial_gauges(tmp_path: Path) -> None:
    e = made(tmp_path, "dial-gauges", GAUGES, "--noise", "dx=2", "--noise", "dy=0.002")
    assert e.quantity == "deflection"
    np.testing.assert_allclose(e.reading[:, :2], [[351e-6, 12e-6], [-349e-6, -11e-6]])
    np.testing.assert_allclose(e.wrench[:, 0], [50, -50])


def test_a_ball_bar_is_a_distance_from_its_centre(tmp_path: Path) -> None:
    circle = [
        f"--set={k}={v}" for k, v in {"centre_x": 0, "centre_y": 420, "centre_z": 0, "radius": 50}.items()
    ]
    e = made(tmp_path, "ball-bar", BALL_BAR, *circle, "--noise", "dd=0.0005")
    np.testing.assert_allclose(e.position, [[0.05, 0.42, 0], [0, 0.47, 0], [-0.05, 0.42, 0]], atol=1e-15)
    assert e.other is not None
    np.testing.assert_allclose(e.other, np.tile([0, 0.42, 0], (3, 1)))
    column = [c.name for c in e.channels].index("dd")
    np.testing.assert_allclose(e.reading[:, column], [1.5e-6, -2e-6, 0.25e-6])


@pytest.mark.parametrize(
    ("header", "size", "unit"),
    [
        ("angle [deg],Radius [mm]", 1.0, ""),
        ("Angle (deg),R (in)", 25.4, ""),
        ("phi,R", 10.0, "deviation=cm"),
        ("Winkel,R", 1.0, ""),
        ("Angle,CW", 1.0, "--map=deviation=CW"),
        ("Angle,Radius error", 1.0, ""),
    ],
)
def test_radii_of_a_circle_are_no_deviations(header: str, size: float, unit: str, tmp_path: Path) -> None:
    circle = [f"--set={k}" for k in ("centre_x=0", "centre_y=420", "centre_z=0", "radius=50")]
    rows = (f"{t},{(50 + d) / size!r}" for t, d in ((0, 0.0015), (90, -0.002), (180, 0.00025)))
    text = "\n".join([header, *rows]) + "\n"
    said = [unit if unit[:2] == "--" else f"--unit={unit}"] if unit else []
    e = made(tmp_path, "ball-bar", text, *circle, *said, "--noise", "dd=0.0005")
    np.testing.assert_allclose(e.reading[:, -1], [1.5e-6, -2e-6, 0.25e-6], atol=1e-12)


def test_cycles_of_iso_9283_are_repeats(tmp_path: Path) -> None:
    e = made(tmp_path, "iso-9283", CYCLES)
    np.testing.assert_allclose(e.reading[:, 0], [10e-6, 12e-6, 3e-6, 5e-6], atol=1e-12)
    assert int(e.groups.max()) + 1 == 2


def test_every_mapping_file_loads_and_bad_ones_are_named(tmp_path: Path) -> None:
    assert instrument_names() == ["ball-bar", "dial-gauges", "iso-9283", "tracker"]
    for name in instrument_names():
        assert load_instrument(name).title
    with pytest.raises(StiffmapError, match="expected ball-bar"):
        load_instrument("sextant")
    (tmp_path / "own.yaml").write_text("title: t\nquantity: position\ncolumns: {x: '('}\n", encoding="utf-8")
    with pytest.raises(StiffmapError, match=r"columns\.x: no regular expression"):
        load_instrument(str(tmp_path / "own.yaml"))
    (tmp_path / "f.csv").write_text(BALL_BAR, encoding="utf-8")
    call = ["experiment", "new", str(tmp_path / "f.csv"), "--machine", "five-bar", "-o", str(tmp_path / "o")]
    assert main([*call, "--instrument", "ball-bar"]) == 2  # no radius
    assert main([*call, "--instrument", "tracker"]) == 2  # not a tracker's file


@pytest.mark.parametrize(
    ("instrument", "text", "units"),
    [
        ("tracker", "cmd_x,cmd_y,cmd_z,actual_x,actual_y,actual_z\n0.05,0.42,0,0.0501,0.42,0\n0,0.4,0,0.0001,0.4,0\n", "length=m"),
        ("iso-9283", "x ref,y ref,z ref,achieved x,achieved y,achieved z\n5,42,0,5.01,42,0\n0,40,0,0.01,40,0\n", "length=cm"),
        ("dial-gauges", "x,y,z,fx,dial x\n0.05,0.42,0,50,0.0001\n0,0.4,0,50,0.0001\n", "length=m"),
        ("tracker", "x_des,x_desired,y_desired,z_desired,x_meas,y_meas,z_meas\n1,50,420,0,50.1,420,0\n2,0,400,0,0.1,400,0\n", "length=mm"),
    ],
)  # fmt: skip
def test_a_unit_of_all_lengths_goes_before_those_of_the_instrument(
    instrument: str, text: str, units: str, tmp_path: Path
) -> None:
    noise = [f"--noise=d{a}=0.01" for a in ("x" if "dial" in text else "xyz")]
    e = made(tmp_path, instrument, text, "--unit", units, *noise)
    np.testing.assert_allclose(e.position, [[0.05, 0.42, 0], [0, 0.4, 0]], atol=1e-12)
    np.testing.assert_allclose(e.reading[:, 0], 1e-4, rtol=1e-9)


def test_a_ball_bar_keeps_its_angle_next_to_a_unit_of_lengths(tmp_path: Path) -> None:
    circle = [f"--set={k}" for k in ("centre_x=0", "centre_y=400", "centre_z=0", "radius=30")]
    e = made(tmp_path, "ball-bar", BALL_BAR, *circle, "--unit", "length=mm", "--noise", "dd=0.001")
    np.testing.assert_allclose(e.reading[:, -1], [1.5e-3, -2e-3, 0.25e-3])


@pytest.mark.parametrize(
    ("header", "named"),
    [
        ("x_ref,y_ref,z_ref,x_meas,y_meas,z_meas", "x_meas"),
        ("actual_x,actual_y,actual_z,cmd_x,cmd_y,cmd_z", "actual_x"),
        ("X Soll,Y Soll,Z Soll,X Ist,Y Ist,Z Ist", "X Ist"),
    ],
)
def test_places_side_by_side_are_asked_for_by_the_instrument(header: str, named: str, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(f"{header}\n0,400,0,0.01,400,0\n50,420,0,50.01,420,0\n")
    with pytest.raises(
        StiffmapError, match=f"a reading.*--instrument tracker, which takes the command off '{named}'"
    ):
        sm.experiment_from_table("five-bar", tmp_path / "t.csv", tmp_path / "o", units={"length": "mm"})
