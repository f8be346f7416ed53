"""Columns that mean something only together: what a sheet says is read with its right value, or refused in one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

import stiffmap as sm
from stiffmap.ui.cli.app import main

G = 9.80665
DH = "theta [deg],d [mm],a [mm],alpha [deg]\n0,120,0,90\n0,0,-430,0\n0,0,-390,0\n0,110,0,90\n0,95,0,-90\n0,80,0,0\n"


def made(folder: Path, text: str, *more: str, machine: str = "linear-delta") -> sm.Experiment | None:
    """The experiment of a sheet; None where it is refused."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "sheet.csv").write_text(text, encoding="utf-8")
    by = ["--dh", str(folder / "dh.csv")] if machine == "dh" else ["--machine", machine]
    (folder / "dh.csv").write_text(DH)
    code = main(["experiment", "new", str(folder / "sheet.csv"), *by, *more, "-o", str(folder / "e")])
    assert code in (0, 2)
    return sm.load_experiment(folder / "e") if code == 0 else None


def arm_sheet(column: str, names: tuple[str, ...]) -> str:
    """Three poses, every reflector read at each."""
    poses = ("10,-20,30,40,50,60", "40,-30,20,10,20,30", "-20,-50,60,20,40,10")
    head = f"Nr,q1,q2,q3,q4,q5,q6,{column},X,Y,Z\n"
    rows = [
        f"{{}},{q},{name},{100 * i + 40 * k},{200 + 60 * k},{300 - 7 * i}"
        for i, q in enumerate(poses)
        for k, name in enumerate(names)
    ]
    return head + "\n".join(row.format(n) for n, row in enumerate(rows, 1)) + "\n"


SEEN = ("--map", "px=X", "--map", "py=Y", "--map", "pz=Z", "--unit", "joints=deg", "--unit", "length=mm",
        "--noise", "dx=0.05", "--noise", "dy=0.05", "--noise", "dz=0.05")  # fmt: skip


@pytest.mark.parametrize(
    ("column", "names"),
    [("Target", ("N1", "N2", "N3")), ("Reflektor", ("SMR-1", "SMR-2")), ("SMR", ("1", "2", "3")), ("Nest Nr.", ("A", "B")),
     ("Point", ("N1", "N2", "N3")), ("Marker ID", ("left", "right"))],
)  # fmt: skip
def test_names_of_reflectors_are_targets(
    column: str, names: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    e = made(tmp_path, arm_sheet(column, names), *SEEN, machine="dh")
    out = capsys.readouterr().out
    assert e is not None and e.target == names * 3 and "WARNING" not in out
    assert f"'{column}' names the target that was read" in out


def test_a_tracker_that_is_named_read_the_places_next_to_joints(tmp_path: Path) -> None:
    text, (by_map, named) = arm_sheet("Target", ("N1", "N2")), (tmp_path / "map", tmp_path / "tracker")
    by_map.mkdir(), named.mkdir()
    one = made(by_map, text, *SEEN, machine="dh")
    other = made(named, text, "--instrument", "tracker", *SEEN[6:], machine="dh")
    assert one is not None and other is not None and other.quantity == "position"
    np.testing.assert_array_equal(one.reading, other.reading)


def test_what_names_no_target_stays_a_note(tmp_path: Path) -> None:
    for column, names in (("Remark", ("a", "b")), ("Target", ("1.25", "2.5"))):
        e = made(tmp_path / names[0], arm_sheet(column, names), *SEEN, machine="dh")
        assert e is not None and not e.target


def test_repeats_far_beyond_the_declared_noise_come_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made(tmp_path, arm_sheet("Remark", ("a", "b")), *SEEN, machine="dh")
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith("WARNING: the declared noise of dx is 0.05 mm") and "28.3 mm" in first


POSES = "x [mm],y [mm],z [mm]"


@pytest.mark.parametrize(
    ("text", "more", "fz", "hung"),
    [
        (f"{POSES};Last [kg];Messuhr Z [mm]\n0;0;300;0;0,0\n0;0;300;2,5;-0,021\n", ("--map", "fz=Last [kg]"), [0, -2.5 * G], True),
        (f"{POSES},mass (g),dial z [um]\n0,0,300,500,-2\n0,0,300,1000,-4\n", (), [-0.5 * G, -G], True),
        (f"{POSES},Gewicht [kg],dz [um]\n0,0,300,1,-2\n0,0,300,3,-4\n", (), [-G, -3 * G], True),
        (f"{POSES},Fz [kg],dz [um]\n0,0,300,1,-2\n0,0,300,3,-4\n", (), [-G, -3 * G], True),
        (f"{POSES},Zusatzmasse [kg],dz [um]\n0,0,300,1,-2\n0,0,300,3,-4\n", (), [-G, -3 * G], True),
        (f"{POSES},Fz [kg],dz [um]\n0,0,300,-1,-2\n0,0,300,-3,-4\n", (), [-G, -3 * G], False),
        (f"{POSES},Load [kg],dz [um]\n0,0,300,1,2\n0,0,300,3,4\n", ("--map", "fz=+Load [kg]"), [G, 3 * G], False),
        (f"{POSES},Load [kg],dz [um]\n0,0,300,1,2\n0,0,300,3,4\n", ("--map", "fz=-Load"), [-G, -3 * G], False),
        (f"{POSES},Load [N],dz [um]\n0,0,300,1,2\n0,0,300,3,4\n", ("--map", "fz=-Load [N]"), [-1, -3], False),
        (f"{POSES},Load [kgf],dz [um]\n0,0,300,1,2\n0,0,300,3,4\n", ("--map", "fz=4"), [G, 3 * G], False),
    ],
)  # fmt: skip
def test_a_mass_hangs(
    text: str,
    more: tuple[str, ...],
    fz: list[float],
    hung: bool,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    e = made(
        tmp_path,
        text.replace(POSES, POSES.replace(",", ";")) if ";" in text else text,
        *more,
        "--noise",
        "dz=2",
    )
    assert e is not None, capsys.readouterr().err
    np.testing.assert_allclose(e.wrench, [[0, 0, f, 0, 0, 0] for f in fz], rtol=1e-12, atol=1e-12)
    assert ("is a mass: its weight pulls along -z" in capsys.readouterr().out) is hung


@pytest.mark.parametrize(
    ("heads", "cells", "more"),
    [
        (("Load [N]", "Direction"), ("100,+x", "50,-Z", "20,x"), ()),
        (("Load [N]", "Direction"), ("100,+x", "50,-Z", "20,x"), ("--map", "fx=Load [N]")),
        (("Kraft [kN]", "Richtung"), ("0.1,X+", "0.05,z-", "0.02,+X"), ()),
        (("Force [N]", "Load direction"), ("100,x", "-50,z", "20,x"), ()),
        (("Masse [kg]", "Richtung"), (f"{100 / G},+x", f"{50 / G},-z", f"{20 / G},x"), ()),
        (("Load", "Axis"), ("100,x", "50,-z", "20,x"), ("--unit", "force=N")),
    ],
)  # fmt: skip
def test_a_load_and_its_direction(
    heads: tuple[str, str], cells: tuple[str, ...], more: tuple[str, ...], tmp_path: Path
) -> None:
    text = f"{POSES},{','.join(heads)},dx [um]\n" + "".join(
        f"{i},0,300,{c},{i + 1}\n" for i, c in enumerate(cells)
    )
    e = made(tmp_path, text, *more, "--noise", "dx=2")
    assert e is not None
    np.testing.assert_allclose(e.wrench[:, :3], [[100, 0, 0], [0, 0, -50], [20, 0, 0]], rtol=1e-12)


def test_a_direction_that_is_none_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = f"{POSES},Load [N],Direction,dx [um]\n0,0,300,10,+x,1\n0,0,300,10,up,1\n"
    assert made(tmp_path, text, "--noise", "dx=2") is None
    err = capsys.readouterr().err
    assert (
        "sheet.csv, line 3: column 'Direction': expected the direction of the load" in err
        and "'up' (cell E3)" in err
    )


@pytest.mark.parametrize(
    ("heads", "more"),
    [
        ("dz unloaded [mm],dz loaded [mm]", ()),
        ("dz unloaded [mm],dz loaded [mm]", ("--map", "dz=dz loaded [mm]")),
        ("Dial Z before [mm],Dial Z after [mm]", ()),
        ("Dial Z pre [mm],Dial Z post [mm]", ()),
        ("dz_pre [mm],dz_post [mm]", ()),
        ("Uhr Z vor [mm],Uhr Z nach [mm]", ()),
        ("dz unloaded [mm],dz [mm]", ()),
        ("unloaded [mm],loaded [mm]", ("--map", "dz=loaded")),
        ("Uhr 1 unbelastet [mm],Uhr 1 belastet [mm]", ("--map", "dz=Uhr 1 belastet")),
        ("dial_z_unloaded,dial_z_loaded", ("--unit", "dz=mm")),
    ],
)
def test_a_gauge_before_and_after(
    heads: str, more: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = f"{POSES},Fz [N],{heads}\n0,0,300,-10,1.250,1.230\n0,0,310,-20,1.250,1.200\n"
    e = made(tmp_path, text, *more, "--noise", "dz=0.002")
    assert e is not None, capsys.readouterr().err
    np.testing.assert_allclose(e.reading[:, 2], [-20e-6, -50e-6], rtol=1e-9)
    assert "dz is '" in capsys.readouterr().out


@pytest.mark.parametrize(
    "heads",
    [
        "Dial Z before [mm],Dial Z loaded [mm],Dial Z after [mm]",
        "Dial Z before loading [mm],Dial Z after loading [mm],Dial Z after unloading [mm]",
        "Uhr Z unbelastet [mm],Uhr Z belastet [mm],Uhr Z entlastet [mm]",
        "dz unloaded [mm],dz loaded [mm],dz unloaded again [mm]",
    ],
)
def test_a_gauge_that_is_read_again_without_the_load(
    heads: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = f"{POSES},Fz [N],{heads}\n0,0,300,-10,1.250,1.230,1.251\n0,0,310,-20,1.250,1.200,1.249\n"
    e = made(tmp_path, text, "--noise", "dz=0.002")
    assert e is not None, capsys.readouterr().err
    np.testing.assert_allclose(e.reading[:, 2], [-20e-6, -50e-6], rtol=1e-9)
    assert f"not used, as read again: '{heads.split(',')[2]}'" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("heads", "more"),
    [
        ("Dial Z 1 unloaded [um],Dial Z 1 loaded [um],Dial Z 2 unloaded [um],Dial Z 2 loaded [um]", ()),
        ("A unloaded,A loaded,B unloaded,B loaded", ("--map", "dz=A loaded|B loaded", "--unit", "dz=um")),
    ],
)
def test_gauges_before_and_after_side_by_side_are_repeats(
    heads: str, more: tuple[str, ...], tmp_path: Path
) -> None:
    text = f"{POSES},Fz [N],{heads}\n0,0,300,-10,250,230,10,-11\n0,0,310,-20,250,200,10,-41\n"
    e = made(tmp_path, text, *more, "--noise", "dz=2")
    assert e is not None
    np.testing.assert_allclose(e.reading[:, 2], [-20e-6, -21e-6, -50e-6, -51e-6], rtol=1e-9)


def test_repeats_in_two_units_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = f"{POSES},Fz [N],A [um],B [mm]\n0,0,300,-10,-20,-0.021\n"
    assert made(tmp_path, text, "--map", "dz=A|B", "--noise", "dz=2") is None
    assert "expected one unit of all repeats of dz; found 'A [um]' and 'B [mm]'" in capsys.readouterr().err


KUKA = "X [mm],Y [mm],Z [mm],A [deg],B [deg],C [deg],Fx [N],dx [um]\n10,0,700,90,0,0,10,1\n20,0,710,0,30,0,10,1\n0,0,700,10,20,30,10,1\n"


@pytest.mark.parametrize(
    "text",
    [
        KUKA,
        KUKA.replace(" [deg]", ""),
        KUKA.replace("A [deg]", "TCP A").replace("B [deg]", "TCP B").replace("C [deg]", "TCP C"),
        KUKA.replace("[deg]", "[rad]")
        .replace("90,0,0,10,1", "1.5707963267948966,0,0,10,1")
        .replace("0,30,0,10,1", "0,0.5235987755982988,0,10,1")
        .replace("10,20,30,10,1", "0.17453292519943295,0.3490658503988659,0.5235987755982988,10,1"),
    ],
)
def test_angles_of_kuka_beside_a_position(text: str, tmp_path: Path) -> None:
    """Expected matrices: Rz(A) Ry(B) Rx(C), multiplied out by hand."""
    e = made(tmp_path, text, "--noise", "dx=2", machine="hexapod")
    assert e is not None and e.rotation is not None and e.rotation_against == "base"
    c, s = np.cos(np.radians([10, 20, 30])), np.sin(np.radians([10, 20, 30]))
    z, y, x = ([[c[0], -s[0], 0], [s[0], c[0], 0], [0, 0, 1]], [[c[1], 0, s[1]], [0, 1, 0], [-s[1], 0, c[1]]],
               [[1, 0, 0], [0, c[2], -s[2]], [0, s[2], c[2]]])  # fmt: skip
    np.testing.assert_allclose(e.rotation[2], np.array(z) @ np.array(y) @ np.array(x), atol=1e-12)
    np.testing.assert_allclose(e.rotation[0], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)


TURN = Rotation.from_euler("xyz", [3.0, -5.0, 7.0], degrees=True)
TURNS = {
    "W [deg],P [deg],R [deg]": TURN.as_euler("xyz", degrees=True),
    "Roll,Pitch,Yaw": TURN.as_euler("xyz", degrees=True),
    "A,B,C": TURN.as_euler("ZYX", degrees=True),
    "RX [rad],RY [rad],RZ [rad]": TURN.as_rotvec(),
    "rx [deg],ry [deg],rz [deg]": TURN.as_rotvec(degrees=True),
    "qw,qx,qy,qz": TURN.as_quat()[[3, 0, 1, 2]],
    "qx,qy,qz,qw": TURN.as_quat(),
    "Q1,Q2,Q3,Q4": TURN.as_quat()[[3, 0, 1, 2]],
    ",".join(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3)): TURN.as_matrix().ravel(),
}


@pytest.mark.parametrize("heads", TURNS)
def test_an_orientation_beside_a_commanded_position(heads: str, tmp_path: Path) -> None:
    cells = ",".join(map(repr, TURNS[heads].tolist()))
    text = f"Pt,X [mm],Y [mm],Z [mm],{heads},Fx [N],dx [um]\nP1,10,0,5,{cells},10,1\nP2,20,0,5,{cells},10,1\n"
    e = made(tmp_path, text, "--noise", "dx=1", machine="hexapod")
    assert e is not None and e.rotation is not None and e.rotation_against == "base"
    np.testing.assert_allclose(e.rotation[1], TURN.as_matrix(), atol=1e-12)
    assert np.isnan(e.reading[:, 3:]).all()


@pytest.mark.parametrize("heads", [h for h in TURNS if "deg],ry" not in h])
def test_an_orientation_beside_a_seen_position(heads: str, tmp_path: Path) -> None:
    cells = ",".join(map(repr, TURNS[heads].tolist()))
    joints = "J1 [deg],J2 [deg],J3 [deg],J4 [deg],J5 [deg],J6 [deg]"
    rows = [f"{100 * k},200,{30 * k},{cells},{10 * k},-20,{30 - 5 * k},40,50,60" for k in range(4)]
    text = f"X meas [mm],Y meas [mm],Z meas [mm],{heads},{joints}\n" + "\n".join(rows)
    noise = [o for a in ("dx", "dy", "dz", "rx", "ry", "rz") for o in ("--noise", f"{a}=0.01")]
    e = made(tmp_path, text, *noise, machine="dh")
    assert e is not None and e.seen_rotation is not None and e.command is not None
    np.testing.assert_allclose(e.seen_rotation[1], TURN.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(np.degrees(e.command[1]), [10, -20, 25, 40, 50, 60])
    assert np.isfinite(e.sigma).all()


def test_turns_that_are_the_reading_stay_readings(tmp_path: Path) -> None:
    text = f"{POSES},rx [mrad],ry [mrad],rz [mrad],Mx [Nm]\n0,0,300,1,2,3,10\n"
    e = made(tmp_path, text, "--noise", "rx=1")
    assert e is not None and e.rotation is None
    np.testing.assert_allclose(e.reading[0, 3:], [1e-3, 2e-3, 3e-3])


BARE = "P1;100.5;50;700;100.031;50.012;699.954;;\nP2;-100;50;700;-99.97;50.015;699.95;;\n"


@pytest.mark.parametrize(
    ("text", "more"),
    [
        (BARE, ("--header", "id,x,y,z,px,py,pz")),
        (BARE, [w for p in ("id=1", "x=2", "y=3", "z=4", "px=5", "py=6", "pz=7") for w in ("--map", p)]),
        (BARE, ("--instrument", "tracker", "--header", "id,x,y,z,px,py,pz")),
        (BARE.replace(".", ","), ("--header", "id,x,y,z,px,py,pz")),
        (BARE.replace(";;", "").replace(";", "  "), ("--header", "id,x,y,z,px,py,pz")),
        (BARE.replace(";;", "").replace(";", "\t"), ("--header", "id,x,y,z,px,py,pz")),
        (f"Name;Soll1;Soll2;Soll3;Ist1;Ist2;Ist3;;\n{BARE}", ("--header", "id,x,y,z,px,py,pz")),
    ],
)
def test_a_table_without_a_header(
    text: str, more: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    e = made(
        tmp_path,
        text,
        *more,
        "--quantity",
        "position",
        "--unit",
        "length=mm",
        "--noise",
        "dx=0.01",
        machine="hexapod",
    )
    assert e is not None and e.seen is not None, capsys.readouterr().err
    assert e.ids == ("P1", "P2")
    np.testing.assert_allclose(e.position, [[0.1005, 0.05, 0.7], [-0.1, 0.05, 0.7]], rtol=1e-12)
    np.testing.assert_allclose(e.seen[0], [0.100031, 0.050012, 0.699954], rtol=1e-12)
    assert "no noise of dy, dz is declared" in capsys.readouterr().out


def test_the_error_names_the_way(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert made(tmp_path, BARE, "--instrument", "tracker", machine="hexapod") is None
    err = capsys.readouterr().err
    assert "--header id,x,y,z" in err and "--map x=2" in err and len(err.strip().splitlines()) == 1
    assert made(tmp_path, BARE, "--header", "id,x,y,z,a,b,c,d,e,f,g", machine="hexapod") is None
    assert "at most 9 names" in capsys.readouterr().err


TWO = f"{POSES},fx [N],dx [um]\n0,0,300,10,1\n10,0,300,10,2\n\nSecond\n{POSES},fy [N],dy [um]\n0,0,310,20,3\n"


def test_several_tables_on_a_sheet(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert made(tmp_path, TWO) is None
    assert "line 6: another table begins here: say --table 1" in capsys.readouterr().err
    for k, axis, z in ((1, "dx", 0.3), (2, "dy", 0.31)):
        e = made(tmp_path / str(k), TWO, "--table", str(k))
        assert e is not None and e.axes == (axis,) and e.position[0, 2] == pytest.approx(z)
    assert made(tmp_path, TWO, "--table", "3") is None
    assert "--table: expected a number from 1 to 2; found 3" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("answer", "load"),
    [("fx=D", [10, 0, 0]), ("fz=-D", [0, 0, -10]), ("fy = 25 N", [0, 25, 0]), ("fz=-12,5", [0, 0, -12.5])],
)
def test_a_dialogue_asks_for_the_load(
    answer: str,
    load: list[float],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    said = iter(["nothing", answer, *(["N"] if "D" in answer else []), "2", ""])
    asked: list[str] = []
    monkeypatch.setattr("builtins.input", lambda text: (asked.append(text), next(said))[1])
    text = f"{POSES},Zug,dx [um],dy [um]\n0,0,300,10,1,1\n"
    e = made(tmp_path, text, "--dialogue")
    assert e is not None, capsys.readouterr().err
    np.testing.assert_allclose(e.wrench[0, :3], load, atol=1e-12)
    assert "no noise of dy is declared" in capsys.readouterr().out
    again = made(tmp_path, text, "--overwrite")  # no question: the answers are remembered
    assert again is not None and np.array_equal(again.wrench, e.wrench)


def test_answers_before_the_end_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    said = iter(["A", "B"])

    def ask(text: str) -> str:
        try:
            return next(said)
        except StopIteration:
            raise EOFError from None

    monkeypatch.setattr("builtins.input", ask)
    assert made(tmp_path, "Ost [mm],Nord [mm],Hoch [mm],Fx [N],dx [um]\n0,0,300,10,1\n", "--dialogue") is None
    err = capsys.readouterr().err
    assert "the answers so far are remembered" in err and len(err.strip().splitlines()) == 1
    (file,) = (tmp_path / "config/stiffmap/sheets").iterdir()
    assert yaml.safe_load(file.read_text(encoding="utf-8"))["map"] == {"x": ["Ost [mm]"], "y": ["Nord [mm]"]}


def test_a_weight_in_newtons_pulls_down_and_gauges_a_b_c_are_no_angles(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    e = made(
        tmp_path,
        f"{POSES},Gewicht [N],A [mm],B [mm],C [mm],dz [um]\n0,0,300,10,1,2,3,-20\n0,0,310,20,1,2,3,-40\n",
    )
    assert e is not None and e.rotation is None
    np.testing.assert_allclose(e.wrench[:, 2], [-10, -20])
    assert "is a weight: it pulls along -z" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("fz", "dz", "wrong"), [(10, -20, True), (-10, 20, True), (10, 20, False), (-10, -20, False)]
)
def test_readings_against_the_load_come_first(
    fz: float, dz: float, wrong: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = f"{POSES},fz [N],dz [um]\n" + "".join(f"{i},0,300,{fz},{dz}\n" for i in range(3))
    assert made(tmp_path, text, "--noise", "dz=2") is not None
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith("WARNING: 3 of 3 readings go against their force (row 1: ") is wrong


def test_rows_without_a_load_that_do_not_read_zero_come_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = f"{POSES},Load [kg],Dial Z [um]\n0,0,300,0,1234\n0,0,300,5,1214\n0,0,310,0,1250\n0,0,310,5,1230\n"
    e = made(tmp_path, text, "--noise", "dz=1")
    out = capsys.readouterr().out
    assert e is not None and out.startswith(
        "WARNING: rows without a load do not read zero (row 1: dz 1.234 mm)"
    )
    assert (
        "write 'unloaded: unknown' into experiment.yaml" in out.replace("\n", " ") and "other sign" not in out
    )


def test_a_lone_reading_without_load_is_not_dropped_in_silence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made(tmp_path, f"{POSES},fz [N],gauge unloaded [mm],dz [um]\n0,0,300,-10,1.25,-20\n", "--noise", "dz=2")
    assert "'gauge unloaded [mm]' is in no reading" in capsys.readouterr().out


SIDE_BY_SIDE = (
    "J1 [deg],J2 [deg],J3 [deg],J4 [deg],J5 [deg],J6 [deg],{}\n10,-20,30,40,50,60,{}\n40,-30,20,10,20,30,{}\n"
)
TRACKER = ("--instrument", "tracker", "--unit", "length=mm")


@pytest.mark.parametrize(
    ("places", "one", "other", "targets"),
    [
        ("N1x [mm],N1y [mm],N1z [mm],N2x [mm],N2y [mm],N2z [mm]", "1,2,3,41,2,3", "7,8,9,7,48,9", ["N1", "N2"] * 2),
        ("SMR a X,SMR a Y,SMR a Z,SMR b X,SMR b Y,SMR b Z", "1,2,3,41,2,3", ",,,7,48,9", ["SMR a", "SMR b", "SMR b"]),
        ("X1,Y1,Z1,X2,Y2,Z2,X3,Y3,Z3", "1,2,3,41,2,3,1,2,50", "7,8,9,7,48,9,54,8,9", ["1", "2", "3"] * 2),
        ("x,y,z,N1x,N1y,N1z,N2x,N2y,N2z", "5,5,5,1,2,3,41,2,3", "5,6,7,7,8,9,7,48,9", ["N1", "N2"] * 2),
        ("A1x,A1y,A1z,A2x,A2y,A2z,x meas,y meas,z meas", "9,9,9,9,9,8,1,2,3", "9,9,9,9,9,8,7,8,9", None),
        ("px1,py1,pz1,px2,py2,pz2", "1,2,3,1.1,2,3", "7,8,9,7,8.1,9", None),
    ],
)  # fmt: skip
def test_places_side_by_side_are_taken_below_each_other(
    places: str, one: str, other: str, targets: list[str] | None, tmp_path: Path
) -> None:
    e = made(tmp_path, SIDE_BY_SIDE.format(places, one, other), *TRACKER, machine="dh")
    rows = np.genfromtxt(tmp_path / "e" / "data.csv", names=True, delimiter=",", dtype=None, encoding=None)
    known = {"x": 3, "A": 6}.get(places[0], 0)  # what the controller says
    read = [v for line in (one, other) for v in line.split(",")[known:] if v]  # what was not read has no row
    wanted = np.array(read, dtype=float).reshape(-1, 3)
    np.testing.assert_array_equal(np.stack([rows[s] for s in ("px", "py", "pz")], axis=1), wanted)
    assert rows["q1"].tolist() == sorted(rows["q1"])
    assert e is not None and (list(e.target) if "target" in rows.dtype.names else None) == targets


@pytest.mark.parametrize(
    ("places", "one", "other"),
    [
        ("Front x,Front y,Front z,Controller x,Controller y,Controller z", "1,2,3,41,2,3", "7,8,9,7,48,9"),
        ("N1x,N1y,N1z,N2x,N2y,N2z", "1,2,3,41,2,3", "7,8,9,7,98,9"),
    ],
)
def test_places_side_by_side_of_other_points_are_refused_with_the_way(
    places: str, one: str, other: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert made(tmp_path, SIDE_BY_SIDE.format(places, one, other), *TRACKER, machine="dh") is None
    err = capsys.readouterr().err
    assert "sheet.csv: expected one place in each row" in err and "--map px='HEADER'" in err


def test_a_deviation_in_another_unit_names_the_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = f"{POSES},Fz [N],dz [mm],u_dz [um]\n0,0,300,-10,-0.02,2\n"
    assert made(tmp_path, text) is None
    assert "sheet.csv: columns dz and u_dz need the same unit; found mm and um" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("first", "second", "way", "axis"),
    [
        ("delta x [mm]", "dx [mm]", "dx", 0),
        ("dx [mm]", "deviation x [um]", "dx", 0),
        ("deflection y [mm]", "dy [mm]", "dy", 1),
    ],
)
def test_two_columns_of_one_reading_are_asked_for(
    first: str, second: str, way: str, axis: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One of them would go to the notes in silence; of the same numbers in another unit it may."""
    head = f"{POSES},fz [N],{first},{second}\n"
    size = 1e3 if "um" in second else 1.0
    text = head + "".join(f"{k},0,300,-100,0.0{k},{0.5 * k * size}\n" for k in range(1, 5))
    noise = ("--noise", f"{way}=0.002")
    assert made(tmp_path / "a", text, *noise) is None
    two = [f"'{header.split(' [')[0]}'" for header in (first, second)]
    assert f"which of {' and '.join(two)} is {way}?" in capsys.readouterr().err
    for named, value in ((first, 0.01e-3), (second, 0.5e-3)):
        e = made(tmp_path / named[:6].replace(" ", "") / str(value), text, "--map", f"{way}={named}", *noise)
        assert e is not None
        np.testing.assert_allclose(e.reading[0, axis], value)
    same = head + "".join(f"{k},0,300,-100,0.0{k},{0.01 * k * size}\n" for k in range(1, 5))
    assert made(tmp_path / "same", same, *noise) is not None


def test_two_columns_of_one_load_are_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = f"{POSES},Fx [N],Force x [N],dx [mm]\n0,0,300,100,200,0.1\n10,0,300,150,100,0.2\n"
    assert made(tmp_path, text, "--noise", "dx=0.002") is None
    assert "which of 'Fx' and 'Force x' is fx?" in capsys.readouterr().err
