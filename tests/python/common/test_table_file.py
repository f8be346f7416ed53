"""What a table does not say itself: names, units, header and which of several, in one way for every command that takes a table."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.tables.pose_table import read_pose_table
from stiffmap.identification.taps import load_taps
from stiffmap.machining.toolpath import load_path
from stiffmap.ui.cli.app import main
from stiffmap.ui.cli.commands import COMMANDS, load
from stiffmap.ui.cli.options import TABLE
from stiffmap.workspace.performance import load_motion

PLAIN = "x [mm],y [mm],z [mm]\n50,30,40\n0,-20,45\n"
STRANGE = "Xist,Quer,Hub,Los\n50,-30,40,7\n0,20,45,7\n"
SAID = {"columns": {"x": "Xist", "y": "-Quer", "z": "3", "note": "Los"}, "units": {"length": "mm"}}
WORDS = ["--map", "x=Xist", "--map", "y=-Quer", "--map", "z=3", "--map", "note=Los", "--unit", "length=mm"]


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    """A table that says all, and one that says nothing of the same."""
    for name, text in (("plain.csv", PLAIN), ("strange.csv", STRANGE)):
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path / "plain.csv", tmp_path / "strange.csv"


def test_names_signs_numbers_and_units_are_those_that_are_said(files):
    plain, strange = files
    said = sm.TableFile(strange, **SAID)
    np.testing.assert_array_equal(read_pose_table(said).position, read_pose_table(plain).position)
    np.testing.assert_array_equal(load_path(said).end, load_path(plain).end)
    places = [load_motion(f).places()[0] for f in (said, plain)]
    np.testing.assert_array_equal(*places)
    commands = [sm.compensate(sm.load_machine("orthoglide-revised"), f).position for f in (said, plain)]
    np.testing.assert_array_equal(*commands)
    plain.write_text(PLAIN.replace("\n", ",7\n").replace("z [mm],7", "z [mm],frequency_Hz"), encoding="utf-8")
    modes = sm.TableFile(
        strange, {"x": "1", "y": "-2", "z": "3", "frequency": "Los"}, {"length": "mm", "frequency": "Hz"}
    )
    for name in ("position", "frequency"):
        np.testing.assert_array_equal(getattr(load_taps(modes), name), getattr(load_taps(plain), name))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("50,0,700\n0,-20,700\n", {"header": ("x", "y", "z"), "units": {"length": "mm"}}),
        ("50 0 700\n0 -20 700\n", {"header": ("x [mm]", "y [mm]", "z [mm]")}),
        ("x,y,z\n0.05,0,0.7\n0,-0.02,0.7\n", {"units": {"x": "m", "y": "m", "z": "m"}}),
        ("Units: mm\nx,y,z\n50,0,700\n0,-20,700\n", {}),
        ("x [m],y,z\n0.05,0,700\n0,-20,700\n", {"units": {"length": "mm"}}),
        ("x [m],y,z\n50,0,700\n0,-20,700\n", {"units": {"x": "mm", "length": "mm"}}),
        ("x,y,z,x old\n50,0,700,1\n0,-20,700,2\n", {"columns": {"note": "x old"}, "units": {"length": "mm"}}),
        ("x,y,z,Xist\n1,0,700,50\n2,-20,700,0\n", {"columns": {"x": "Xist"}, "units": {"length": "mm"}}),
        ("x [mm],y [mm],z [mm]\n50,0,700\n0,-20,700\n\nx [mm],fx [N]\n1,2\n3,4\n", {"which": 1}),
    ],
)
def test_headers_units_and_one_of_several_tables(tmp_path: Path, text: str, said: dict[str, Any]):
    (tmp_path / "t.csv").write_text(text, encoding="utf-8")
    found = read_pose_table(sm.TableFile(tmp_path / "t.csv", **said))
    np.testing.assert_allclose(found.position, 1e-3 * np.array([[50, 0, 700], [0, -20, 700]]), rtol=1e-15)


def test_angles_without_a_unit_are_in_the_one_that_is_said(tmp_path: Path):
    file = tmp_path / "t.csv"
    file.write_text("x [mm],y [mm],z [mm],A,B,C\n0,0,0,90,0,0\n0,0,0,0,0,45\n", encoding="utf-8")
    degrees = read_pose_table(file).orientation
    file.write_text(
        f"x [mm],y [mm],z [mm],A,B,C\n0,0,0,{np.pi / 2},0,0\n0,0,0,0,0,{np.pi / 4}\n", encoding="utf-8"
    )
    for units in ({"angle": "rad"}, dict.fromkeys("ABC", "rad")):
        np.testing.assert_allclose(
            read_pose_table(sm.TableFile(file, units=units)).orientation, degrees, atol=1e-15
        )


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ({}, "unknown column 'Xist'.*--map x='Xist', or leave it out: --map note='Xist'"),
        ({"columns": {"x": "Xost"}}, r"strange\.csv: --map: no column 'Xost'; there are: Xist, Quer, Hub, Los"),
        ({**SAID, "units": {}}, r"line 1: x: the unit is missing: write x \[mm\] or say --unit x=mm"),
        ({**SAID, "units": {"Xost": "mm"}}, "--unit Xost: no column has this name or meaning; columns: x, y, z"),
        ({**SAID, "units": {"length": "furlong"}}, r"expected a unit such as in x \[mm\], found furlong"),
        ({**SAID, "columns": {**SAID["columns"], "q": "Hub"}}, "unknown column 'q'"),
        ({"which": 3}, "--table: expected a number from 1 to 1; found 3"),
        ({"header": tuple("abcde")}, "--header: expected at most 4 names"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_said(files, said: dict[str, Any], message: str):
    with pytest.raises(sm.StiffmapError, match=message):
        read_pose_table(sm.TableFile(files[1], **said))


@pytest.mark.parametrize("name", ["plain.ngc", "motion.yaml"])
def test_only_a_table_takes_them(tmp_path: Path, name: str):
    (tmp_path / name).write_text("G1 X1\n", encoding="utf-8")
    with pytest.raises(sm.StiffmapError, match="columns, units and the like are of a table"):
        (load_motion if name.endswith("yaml") else load_path)(sm.TableFile(tmp_path / name, **SAID))


TAKE_TABLES = {"solve", "import", "efforts", "experiment", "compensate", "mill", "process", "taps"}


def test_every_command_that_takes_a_table_has_all_of_them():
    found = {c.name for c in COMMANDS if {*TABLE} <= {*load(c).__annotations__}}
    assert found == TAKE_TABLES


def printed(capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, Any]:
    main([*words, "--json"])
    answer: dict[str, Any] = json.loads(capsys.readouterr().out)
    return {k: v for k, v in answer.items() if k != "path"}


@pytest.mark.parametrize(
    ("words", "more"),
    [
        (["solve", "orthoglide-revised", "--at"], ["--force", "0,0,-100"]),
        (["efforts", "orthoglide-revised"], ["--duration", "2"]),
        (["compensate", "orthoglide-revised"], ["--force", "0,0,-100"]),
        (["mill", "orthoglide-revised"], ["--process", "trimming", "--at", "0,0,-40"]),
    ],
)
def test_a_strange_table_with_options_is_a_plain_one(files, capsys, words: list[str], more: list[str]):
    plain, strange = (str(f) for f in files)
    assert printed(capsys, *words, strange, *more, *WORDS) == printed(capsys, *words, plain, *more)


def test_a_table_of_denavit_and_hartenberg_with_options(tmp_path: Path, capsys):
    text = "theta [deg],d [mm],a [mm],alpha [deg]\n0,300,0,90\n0,0,400,0\n0,0,300,0\n"
    (tmp_path / "dh.csv").write_text(text, encoding="utf-8")
    other = text.replace("theta [deg],d [mm],a [mm],alpha [deg]", "W1,L1,L2,W2")
    (tmp_path / "arm.csv").write_text(other, encoding="utf-8")
    said = [
        w
        for n, h in (("theta", "W1"), ("d", "L1"), ("a", "3"), ("alpha", "W2"))
        for w in ("--map", f"{n}={h}")
    ]
    said += ["--unit", "length=mm", "--unit", "angle=deg"]
    for file, more in (("dh.csv", []), ("arm.csv", said)):
        assert main(["import", str(tmp_path / file), *more, "-o", str(tmp_path / f"{file}.yaml")]) == 0
    capsys.readouterr()
    one, other_one = (sm.load_machine(tmp_path / f"{f}.csv.yaml") for f in ("dh", "arm"))
    np.testing.assert_array_equal(one.description.home.p, other_one.description.home.p)


def test_options_without_a_table(capsys):
    for words, message in (
        (["solve", "tripteron", "--unit", "x=mm"], "only with a table"),
        (["solve", "tripteron", "--at", "300,300,300", "--unit", "x=mm"], "found a position"),
        (["mill", "tripteron", "circle", "--process", "trimming", "--unit", "x=mm"], "found an outline"),
        (["import", "arm.urdf", "--unit", "a=mm"], "found a URDF"),
    ):
        assert main(words) == 2
        assert message in capsys.readouterr().err


JOINTS = np.deg2rad([[0.0, -90, 90, -90, -90, 0], [10.0, -80, 85, -60, -75, 30]])


@pytest.mark.parametrize(
    ("names", "said", "size"),
    [
        ("j1 [deg],j2 [deg],j3 [deg],j4 [deg],j5 [deg],j6 [deg]", {}, 1.0),
        ("A1,A2,A3,A4,A5,A6", {"units": {"joints": "deg"}}, 1.0),
        ("q1,q2,q3,q4,q5,q6", {"units": {"angle": "rad"}}, np.pi / 180),
        ("q_1_deg,q_2_deg,q_3_deg,q_4_deg,q_5_deg,q_6_deg", {}, 1.0),
        ("a,b,c,d,e,f", {"columns": {f"q{k}": str(k) for k in range(1, 7)}, "units": {"joints": "deg"}}, 1.0),
        (
            "q1 [arcmin],q2,q3,q4,q5,q6",
            {"units": dict.fromkeys([f"q{k}" for k in range(1, 7)], "arcmin")},
            60.0,
        ),
    ],
)
def test_a_table_may_command_joints(tmp_path: Path, capsys, names: str, said: dict[str, Any], size: float):
    rows = [",".join(map(repr, [*(np.rad2deg(q) * size).tolist(), -100.0])) for q in JOINTS]
    file = tmp_path / "q.csv"
    file.write_text("\n".join([f"{names},fz [N]", *rows]), encoding="utf-8")
    arm = sm.load_machine("ur10")
    table = sm.TableFile(file, **said)
    words = [w for n, v in table.columns.items() for w in ("--map", f"{n}={v}")]
    words += [w for n, v in table.units.items() for w in ("--unit", f"{n}={v}")]
    found = printed(capsys, "solve", "ur10", "--at", str(file), *words)
    expected = arm.solve_joints(JOINTS, [0, 0, -100, 0, 0, 0])
    np.testing.assert_allclose([p["displacement"] for p in found["poses"]], expected.displacement, rtol=1e-9)
    assert expected.unloaded is not None
    places = [p["position"] for p in found["poses"]]
    np.testing.assert_allclose(places, expected.unloaded.position, atol=1e-12)
    commands = sm.compensate(arm, table).actuators
    np.testing.assert_allclose(
        commands, sm.compensate(arm, actuators=JOINTS, wrench=[0, 0, -100, 0, 0, 0]).actuators
    )


def test_joints_that_are_not_clear_are_asked_for(tmp_path: Path, capsys):
    for text, message in (
        ("q1,q2\n0,1\n1,2\n", "which column commands arm.elbow"),
        ("q1,q2,q3,q4,q5,q6\n0,1,1,1,1,1\n1,2,1,1,1,1\n", "has no unit: .* say --unit joints="),
        ("a,b\n0,1\n1,2\n", "unknown column 'a'"),
    ):
        (tmp_path / "q.csv").write_text(text, encoding="utf-8")
        with pytest.raises(sm.StiffmapError, match=message):
            sm.compensate("ur10", tmp_path / "q.csv")
    (tmp_path / "q.csv").write_text("q1,q2,q3,q4,q5,q6\n0,1,1,1,1,1\n1,2,1,1,1,1\n", encoding="utf-8")
    turned = ["--rotation", "0,0,10", "--unit", "joints=rad"]
    assert main(["solve", "ur10", "--at", str(tmp_path / "q.csv"), *turned]) == 2
    assert "has orientations of its own" in capsys.readouterr().err


def test_joints_and_what_follows_from_them(tmp_path: Path):
    file = tmp_path / "q.csv"
    file.write_text(
        "q1 [deg],q2 [deg],q3 [deg],q4 [deg],q5 [deg],q6 [deg],A,B,C\n0,-90,90,-90,-90,0,0,90,0\n", "utf-8"
    )
    with pytest.raises(sm.StiffmapError, match="joints are commanded, so the orientation follows from them"):
        sm.compensate("ur10", file)
    file.write_text("q1 [deg],q2 [deg],q3 [deg],q4 [deg],q5 [deg],q6 [deg]\n0,-90,90,-90,-90,0\n", "utf-8")
    with pytest.raises(sm.StiffmapError, match="either position or actuators"):
        sm.compensate("ur10", file, actuators=JOINTS)
