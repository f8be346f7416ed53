"""Tables of Denavit and Hartenberg, and tables of commanded joints: one command to machine and experiment."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import stiffmap as sm
from stiffmap.common.errors import StiffmapError
from stiffmap.common.tables.sheet import read_sheet
from stiffmap.experiment import Predictor
from stiffmap.experiment.noise.whitening import LinearProblem, nuisance_part
from stiffmap.experiment.spreadsheet import dh
from stiffmap.experiment.spreadsheet.answers import _are_radians
from stiffmap.experiment.spreadsheet.dh import arm, read_dh
from stiffmap.model.description import Joint
from stiffmap.ui.cli import main

UR10 = (
    ("base", 0.0, 127.3, 0.0, 90.0),
    ("shoulder", 0.0, 0.0, -612.0, 0.0),
    ("elbow", 0.0, 0.0, -572.3, 0.0),
    ("wrist_1", 0.0, 163.941, 0.0, 90.0),
    ("wrist_2", 0.0, 115.7, 0.0, -90.0),
    ("wrist_3", 0.0, 92.2, 0.0, 0.0),
)


def table(rows: object = UR10) -> str:
    lines = [",".join(map(str, r)) for r in rows]  # type: ignore[attr-defined]
    return "\n".join(["joint,theta [deg],d [mm],a [mm],alpha [deg]", *lines]) + "\n"


def turn_z(t: float, d: float) -> np.ndarray:
    c, s = np.cos(t), np.sin(t)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, d], [0, 0, 0, 1.0]])


def turn_x(t: float, a: float) -> np.ndarray:
    c, s = np.cos(t), np.sin(t)
    return np.array([[1, 0, 0, a], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1.0]])


def write(folder: Path, name: str, text: str) -> str:
    (folder / name).write_text(text, encoding="utf-8")
    return str(folder / name)


ZEROS = "joint,theta,d [mm],a [mm],alpha [deg]\n1,{},127.3,0,90\n2,{},0,-612,0\n3,{},0,-572.3,0\n"


@pytest.mark.parametrize(
    "text",
    [
        "joint,theta [pi],d [mm],a [mm],alpha [pi]\n1,0,400,25,1/2\n2,-1/2,0,455,0\n3,0,0,35,-1/2\n",
        "joint,theta [π rad],d [mm],a [mm],alpha [pi rad]\n1,0,400,25,0.5\n2,-.5,0,455,\n3,0,0,35,-0.5\n",
        "Units: [mm], [deg]\njoint,theta,d,a,alpha\n1,0,400,25,90\n2,-90,0,455,0\n3,0,0,35,-90\n",
        "joint,theta,d [mm],a [mm],alpha [deg],offset [deg]\n1,q1,400,25,90,0\n2,q2,0,455,0,-90\n3,q3,0,35,-90,0\n",
        "joint,type,theta [deg],d [mm],a [mm],alpha [deg],offset [deg]\n1,R,0,400,25,90,0\n2,R,0.0,0,455,0,-90\n3,R,0,0,35,-90,0\n",
        "joint,theta [deg],d [mm],a [mm],alpha [deg]\n1,th1,400,25,90\n2,th2 - 90,0,455,0\n3,th3,0,35,-90\n",
    ],
)  # fmt: skip
def test_one_arm_as_many_write_it(text: str, tmp_path: Path) -> None:
    found = read_dh(read_sheet(Path(write(tmp_path, "dh.csv", text))), {}, "standard")
    wanted = [(0, 0.4, 0.025, 90), (-90, 0, 0.455, 0), (0, 0, 0.035, -90)]
    each = [(math.degrees(r.theta), r.d, r.a, math.degrees(r.alpha)) for r in found]
    np.testing.assert_allclose(each, wanted, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1,0,400,25,90\n2,0,0,455,0\n3,0,0,35,90\n", "such as joint, theta \\[deg\\], d"),
        ("joint,type,theta [deg],d [mm],a [mm],alpha [deg],offset [deg]\n1,R,0,400,25,90,0\n2,P,0,0,455,0,-90\n", "are both theta"),
        ("joint,theta [deg],d [mm],a [mm],alpha [deg],offset [deg]\n1,5,400,25,90,0\n2,0,0,455,0,-90\n", "are both theta"),
    ],
)  # fmt: skip
def test_tables_of_arms_that_are_not_clear_say_what_one_has(text: str, said: str, tmp_path: Path) -> None:
    file, made = write(tmp_path, "dh.csv", text), tmp_path / "m.yaml"
    with pytest.raises(StiffmapError, match=said) as found:
        read_dh(read_sheet(Path(file), layout=dh.LAYOUT), {}, "standard")
    assert "--header" not in str(found.value)
    assert main(["import", file, "-o", str(made)]) == 2 and not made.exists()


@pytest.mark.parametrize("cells", [("0", "0", "0"), ("q1", "q2", "q3"), ("θ1", "θ2", "0*")])
def test_angles_that_are_zero_need_no_unit(cells: tuple[str, ...], tmp_path: Path) -> None:
    sheet = read_sheet(Path(write(tmp_path, "dh.csv", ZEROS.format(*cells))))
    found = [(r.theta, r.a) for r in read_dh(sheet, {}, "standard")]
    np.testing.assert_allclose(found, [(0, 0), (0, -0.612), (0, -0.5723)])
    with pytest.raises(StiffmapError, match=r"column 'theta' .* has no unit"):
        read_dh(read_sheet(Path(write(tmp_path, "dh.csv", ZEROS.format("0", "0.5", "0")))), {}, "standard")
    limits = ZEROS.format(*cells).replace("\n", ",90\n").replace("[deg],90", "[deg],max")
    with pytest.raises(StiffmapError, match=r"column 'theta' .* has no unit"):
        read_dh(read_sheet(Path(write(tmp_path, "dh.csv", limits))), {}, "standard")


@pytest.mark.parametrize(
    ("unit", "lengths", "reach"),
    [("m", 1.0, r"1\.31e\+03"), ("um", 1.0, "0.00131"), ("mm", 0.0, "0")],
)
def test_an_arm_of_a_kilometre_is_refused(unit: str, lengths: float, reach: str, tmp_path: Path) -> None:
    text = ZEROS.format(0, 0, 0).replace("mm", unit)
    sheet = read_sheet(Path(write(tmp_path, "dh.csv", text)))
    rows = [replace(r, d=lengths * r.d, a=lengths * r.a) for r in read_dh(sheet, {}, "standard")]
    with pytest.raises(StiffmapError, match=f"the arm reaches {reach} m: say the unit of its lengths"):
        arm(rows, "standard", "own")
    rows = read_dh(sheet, {"a": "mm", "d": "mm"}, "standard")
    made = arm(rows, "standard", "own")
    low, high = np.array(made.workspace)
    lengths = sum(abs(r.a) + abs(r.d) for r in rows)
    assert len(made.legs) == 1 and np.ptp(high - low) < 1e-12
    assert (
        0.2 * lengths < (high - low)[0] <= 0.4 * lengths + 1e-12
    )  # two fifths of a reach of half of them or more


@pytest.mark.parametrize(
    "line", ["Units: mm, deg", "Units,mm,deg", "# Units: mm, deg", "Length unit,mm\nAngle unit,deg"]
)
def test_units_of_a_line_above_the_header_hold_where_commas_part_it(line: str, tmp_path: Path) -> None:
    text = f"{line}\n" + ZEROS.format(0, 90, 0).replace(" [mm]", "").replace(" [deg]", "")
    rows = read_dh(read_sheet(Path(write(tmp_path, "dh.csv", text))), {}, "standard")
    found = [(r.d, r.alpha, r.theta) for r in rows[:2]]
    np.testing.assert_allclose(found, [(0.1273, np.pi / 2, 0), (0, 0, np.pi / 2)])


def test_columns_of_a_table_of_dh_that_are_not_used_are_said(tmp_path: Path) -> None:
    text = ZEROS.format(0, 0, 0).replace("\n", ",4\n").replace("[deg],4", "[deg],mass [kg]")
    joints = write(tmp_path, "joints.csv", "J1 [deg],J2 [deg],J3 [deg],Fz [N],dz [mm]\n0,10,20,-100,-0.1\n")
    dh = write(tmp_path, "dh.csv", text)
    made = sm.experiment_from_table(None, joints, tmp_path / "out", dh=dh, noise={"dz": 0.01})
    assert f"left out of {dh}: column 'mass [kg]'" in made.remarks


@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_an_arm_stands_where_its_table_says(
    convention: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Against products of screws written out here; the third joint slides, the fourth has an offset."""
    rng = np.random.default_rng(3)
    rows = [
        ("a", 0, 200, 30, 90, "R"), ("b", 20, 0, 400, 0, "R"), ("c", 0, 100, 0, -90, "P"),
        ("d", -35, 50, 10, 90, "R"), ("e", 0, 0, 0, -90, "R"), ("f", 0, 80, 0, 0, "R"),
    ]  # fmt: skip
    text = "joint,theta [deg],d [mm],a [mm],alpha [deg],type\n" + "\n".join(
        ",".join(map(str, r)) for r in rows
    )
    file = write(tmp_path, "arm.csv", text)
    out = tmp_path / "arm.yaml"
    assert main(["import", file, "--dh-convention", convention, "-o", str(out)]) == 0
    assert "6 actuators" in capsys.readouterr().out
    machine = sm.load_machine(out)
    for q in rng.uniform(-0.6, 0.6, (5, 6)):
        real = sm.forward_kinematics(machine, q)
        at = np.eye(4)
        for (_, theta, d, a, alpha, kind), v in zip(rows, q, strict=True):
            own = turn_z(np.radians(theta) + v * (kind == "R"), d / 1e3 + v * (kind == "P"))
            link = turn_x(np.radians(alpha), a / 1e3)
            at = at @ own @ link if convention == "standard" else at @ link @ own
        assert real.position == pytest.approx(at[:3, 3], abs=1e-12)
        assert real.rotation == pytest.approx(at[:3, :3], abs=1e-12)
    for more in (["--tip", "a"], ["--sidecar", "side.yaml"]):  # of a URDF
        assert main(["import", file, *more, "-o", str(out)]) == 2
        assert f"{more[0]}: expected a URDF with this option, found a table" in capsys.readouterr().err
    jacobian_is_regular = np.linalg.cond(sm.jacobian(machine)) if hasattr(sm, "jacobian") else 1.0
    assert jacobian_is_regular < 1e4


def session(tmp_path: Path) -> tuple[str, str, np.ndarray]:
    """Joints, targets and target minus actual of a reflector somewhere on the flange, in a tracker's own frame."""
    q = np.radians([0, -60, 90, -120, -90, 0]) + np.random.default_rng(5).uniform(-0.7, 0.7, (25, 6))
    spot = np.array([0.02, -0.05, 0.11, 1.0])
    place = np.zeros((25, 3))
    for i, angles in enumerate(q + [0, 0, 2e-4, 0, 0, 0]):  # the elbow stands further than it is told
        at = np.eye(4)
        for (_, _, d, a, alpha), v in zip(UR10, angles, strict=True):
            at = at @ turn_z(v, d / 1e3) @ turn_x(np.radians(alpha), a / 1e3)
        place[i] = (at @ spot)[:3]
    frame = turn_z(0.7, 0.4) @ turn_x(0.05, -2.0)
    actual = 1e3 * (place @ frame[:3, :3].T + frame[:3, 3])
    target = np.round(actual + 1.5)
    head = [*(f"joint_{i}" for i in range(1, 7)), *"XYZ", "x_dif", "y_dif", "z_dif"]
    body = np.hstack([np.degrees(q), target, target - actual])
    text = ",".join(head) + "\n" + "\n".join(",".join(f"{v:.10g}" for v in row) for row in body)
    return write(tmp_path, "poses.csv", text), write(tmp_path, "dh.csv", table()), q


UNITS = ("--unit", "length=mm", "--noise", "dx=0.01", "--noise", "dy=0.01", "--noise", "dz=0.01")


def left(machine: sm.Machine, folder: Path) -> float:
    p = Predictor(machine, sm.load_experiment(folder))
    e, base = p.experiment, p()
    rest = e.reading - base
    rest = rest - nuisance_part(LinearProblem.of(e, e.sigma, base), rest)
    return float(np.sqrt(np.nanmean(rest[:, :3] ** 2)))


def test_one_command_makes_machine_and_experiment(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    poses, dh, q = session(tmp_path)
    out = tmp_path / "tracker"
    arguments = ["experiment", "new", poses, "--dh", dh, "-o", str(out), *UNITS]
    assert main([*arguments, "--difference", "target-minus-actual"]) == 0
    told = capsys.readouterr().out
    assert "'joint_2': command of arm.shoulder, deg" in told and "taken as degrees" in told
    assert "places are targets less differences" in told
    e = sm.load_experiment(out)
    assert (e.quantity, e.frame, e.tool) == ("position", "unknown", "unknown")
    assert e.command == pytest.approx(q, abs=1e-9)
    machine = sm.load_machine(out / "machine.yaml")
    assert left(machine, out) > 1e-5
    assert left(machine.with_effect("zero_offset", element="elbow", error=2e-4), out) < 1e-6
    assert main([*arguments, "--overwrite"]) == 0  # the other sign is another machine
    assert left(machine.with_effect("zero_offset", element="elbow", error=2e-4), out) > 5e-4


def test_columns_go_by_name_by_number_or_as_they_are_mapped(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    values = ",".join(map(str, [0, -60, 90, -120, -90, 0, 0.01, 0.02, -0.01]))
    readings = "dx [mm],dy [mm],dz [mm]"
    named = "base [deg],arm.shoulder [deg],Elbow [deg],wrist_1 [deg],wrist_2 [deg],wrist_3 [deg]"
    numbered = ",".join(f"q{i} [deg]" for i in range(1, 7))
    strange = "m1 [deg],m2 [deg],m3 [deg],m4 [deg],m5 [deg],m6 [deg]"
    short = ("base", "shoulder", "elbow", "wrist_1", "wrist_2", "wrist_3")
    mapped = [x for i, n in enumerate(short, 1) for x in ("--map", f"{'arm.' * (i % 2)}{n}=m{i}")]
    for k, (head, more) in enumerate(((named, []), (numbered, []), (strange, mapped))):
        file = write(tmp_path, f"{k}.csv", f"{head},{readings}\n{values}\n")
        out = tmp_path / str(k)
        code = main(
            ["experiment", "new", file, "--machine", "ur10", "--quantity", "position", "-o", str(out), *more]
        )
        assert code == 0, capsys.readouterr().err
        e = sm.load_experiment(out)
        assert e.command is not None
        assert e.command[0] == pytest.approx(np.radians([0, -60, 90, -120, -90, 0]))
        assert e.reading[0, :3] == pytest.approx([1e-5, 2e-5, -1e-5])
        Predictor(sm.load_machine("ur10"), e)()  # the folder is a valid one


@pytest.mark.parametrize("form", ["names", "numbers alone", "sheets"])
def test_joints_and_places_stand_in_tables_of_their_own(form: str, tmp_path: Path) -> None:
    poses, dh, q = session(tmp_path)
    actual = np.genfromtxt(poses, delimiter=",", names=True)
    actual = np.column_stack([actual[a] - actual[f"{a.lower()}_dif"] for a in "XYZ"])
    plain = form == "numbers alone"
    order = np.arange(len(q)) if plain else np.random.default_rng(1).permutation(len(q))
    joints, places = ([[*([] if plain else [f"P{i}"]), *values[i].tolist()] for i in rows] for values, rows in (
        (np.degrees(q), range(len(q))), (actual, order)
    ))  # fmt: skip
    if not plain:
        joints.insert(0, ["Point", *(f"A{i}" for i in range(1, 7))])
        places.insert(0, ["Name", "X [mm]", "Y [mm]", "Z [mm]"])
    if form == "sheets":
        openpyxl = pytest.importorskip(
            "openpyxl", reason="openpyxl is not installed (pip install stiffmap[excel])"
        )
        book = openpyxl.Workbook()
        for row in joints:
            book.active.append(row)
        page = book.create_sheet("Tracker")
        for row in places:
            page.append(row)
        book.save(tmp_path / "both.xlsx")
        files, said = [str(tmp_path / "both.xlsx")], "source: both.xlsx"
    else:
        text = [
            "\n".join(sign.join(map(str, row)) for row in rows)
            for rows, sign in ((joints, ";"), (places, ","))
        ]
        files = [
            write(tmp_path, name, t) for name, t in zip(("joints.csv", "tracker.txt"), text, strict=True)
        ]
        said = "title: from joints.csv and tracker.txt"
    more = ["--header", "A1,A2,A3,A4,A5,A6,px,py,pz", "--unit", "joints=deg"] if plain else []
    out = tmp_path / "out"
    assert main(["experiment", "new", *files, "--dh", dh, "-o", str(out), *UNITS, *more]) == 0
    e = sm.load_experiment(out)
    assert e.command == pytest.approx(q[order], abs=1e-9) and (e.frame, e.tool) == ("unknown", "unknown")
    assert e.seen == pytest.approx(1e-3 * actual[order], abs=1e-9)
    machine = sm.load_machine(out / "machine.yaml")
    assert left(machine.with_effect("zero_offset", element="elbow", error=2e-4), out) < 1e-6
    assert said in (out / "experiment.yaml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "head", ["X meas [mm],Y meas [mm],Z meas [mm]", "x_measured [mm],y_measured [mm],z_measured [mm]"]
)
def test_measured_positions_are_places_and_named_once(
    head: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    joints = ",".join(f"q{i} [deg]" for i in range(1, 7))
    text = f"{joints},{head}\n0,-60,90,-120,-90,0,2000,10,-20\n"
    out = tmp_path / "e"
    assert (
        main(["experiment", "new", write(tmp_path, "t.csv", text), "--machine", "ur10", "-o", str(out)]) == 0
    )
    told = capsys.readouterr().out
    assert "notes.csv" not in told and f"'{head.split(',')[0]}': px, mm" in told
    assert "reads px, py, pz" in told and "--noise dx=<one sigma in mm>" in told
    e = sm.load_experiment(out)
    assert e.seen is not None and (e.frame, e.tool) == ("unknown", "unknown")
    assert e.seen[0] == pytest.approx([2.0, 0.01, -0.02])
    mapped = [x for a, h in zip("xyz", ("m", "n", "o"), strict=True) for x in ("--map", f"p{a}={h}")]
    text = f"{joints},m [in],n [in],o [in]\n0,-60,90,-120,-90,0,80,10,-20\n"
    file = write(tmp_path, "m.csv", text)
    arguments = ["experiment", "new", file, "--machine", "ur10", "-o", str(out), *mapped]
    assert main([*arguments, "--overwrite"]) == 0
    told = capsys.readouterr().out
    assert "'px of m [mm]': px, mm" in told
    e = sm.load_experiment(out)
    assert e.seen is not None and e.seen[0] == pytest.approx([80 * 0.0254, 0.254, -20 * 0.0254])


@pytest.mark.parametrize(
    ("angles", "radians"), [([-1.57, np.nan], True), ([0.5, 7.5], False), ([1.0, 2.0], False)]
)
def test_fractions_of_a_turn_look_like_radians(angles: list[float], radians: bool) -> None:
    assert _are_radians(np.array(angles)) == radians


@pytest.mark.parametrize(
    ("head", "more", "asked"),
    [
        ("q1 [deg],q2 [deg],q3 [deg],q4 [deg],q5 [deg],dx [mm]", [], "which column commands arm.wrist_3? Say --map"),
        ("q1 [deg],q2 [deg],q3 [deg],q4 [deg],q5 [deg],q6 [deg],m,n,o", [], "Say --map px='HEADER' (py, pz) for measured positions"),
        ("q1,q2,q3,q4,q5,q6,dx [mm]", [], "(arm.base) has no unit: write it in the header, as in 'q1 [deg]', or say --unit joints=deg"),
        ("q1,q2,q3,q4,q5,q6,dx [mm]", [], "as in 'q1 [rad]', or say --unit joints=rad (--unit angle=rad"),
        ("q1,q2,q3,q4,q5,q6,dx [mm]", ["--unit", "joints=mm"], "(arm.base): the unit 'mm' is not one of this quantity; those of angle are"),
        ("q1 [deg],q2 [deg],q3 [deg],q4 [deg],q5 [deg],q6 [deg],x,y,z", [], "if an instrument read them, say --map px='x'"),
        ("q1 [deg],q2 [deg],q3 [deg],q4 [deg],q5 [deg],q6 [deg],dx [mm]", ["--map", "arm.wrist=q6"], "no drive 'arm.wrist'"),
        ("q1 [deg],q2 [deg],q3 [deg],q4 [deg],q5 [deg],q6 [deg],dx [mm]", ["--difference", "both"], "difference: expected"),
    ],
)  # fmt: skip
def test_what_is_not_clear_is_asked(
    head: str, more: list[str], asked: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    turn = "-1.57" if "rad" in asked else "1"
    file = write(tmp_path, "t.csv", head + "\n" + ",".join([turn] * (head.count(",") + 1)) + "\n")
    assert main(["experiment", "new", file, "--machine", "ur10", "-o", str(tmp_path / "e"), *more]) == 2
    assert asked in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ("q1,q2,q3,q4,q5,q6", "'q1' goes to 8.192e+04: expected an angle; of counts of an encoder"),
        ("enc1,enc2,enc3,enc4,enc5,enc6", "which column commands arm.base? Say --map arm.base="),
        ("S [pulse],L [pulse],U [pulse],R [pulse],B [pulse],T [pulse]", "which column commands arm.base?"),
    ],
)
def test_counts_of_encoders_are_no_degrees(names: str, said: str, tmp_path: Path) -> None:
    """And with a table of the arm nobody is asked for positions x, y, z."""
    file = write(tmp_path, "t.csv", f"{names},px [mm],py [mm],pz [mm]\n" + "81920,1,2,3,4,5,6,7,8\n" * 2)
    arm_file = write(tmp_path, "dh.csv", table())
    with pytest.raises(StiffmapError) as found:
        sm.experiment_from_table(None, file, tmp_path / "e", dh=arm_file)
    assert said in str(found.value)


def test_units_of_joints_and_of_places_are_said(tmp_path: Path) -> None:
    """Minutes of arc, and px py pz in metres by --unit of each, are the same readings as degrees and mm."""
    joints = (0, -60, 90, -120, -90, 0)
    heads = {"deg,mm": ("deg", 1, 1.0), "arcmin,m": ("arcmin", 60, 1e-3)}
    made = []
    for name, (unit, turns, size) in heads.items():
        head = ",".join([*(f"q{k} [{unit}]" for k in range(1, 7)), "px", "py", "pz"])
        row = ",".join(map(str, (*(turns * q for q in joints), 800 * size, 100 * size, -200 * size)))
        file = write(tmp_path, f"{unit}.csv", f"{head}\n{row}\n")
        said = dict.fromkeys(("px", "py", "pz"), name.split(",")[1])
        made.append(sm.experiment_from_table("ur10", file, tmp_path / unit, units=said).experiment)
    one, other = made
    assert one.command is not None and one.seen is not None
    np.testing.assert_allclose(other.command, one.command, rtol=1e-12)
    np.testing.assert_allclose(one.seen, [[0.8, 0.1, -0.2]], rtol=1e-12)
    np.testing.assert_allclose(other.seen, one.seen, rtol=1e-12)


DH = "theta [deg],d [mm],a [mm],alpha [deg]"
MODIFIED = ("Modified DH parameters", "Arm by Craig", "# DH (modified)")
MORE = (("beta", "2"), ("sign", "-1"), ("direction", "cw"))
DEGREES = ("90,0,1,0,-3,3", "0,0,1,-90,-3,3", "0,0,1,0,-170,170")


@pytest.mark.parametrize("unit", ["deg", "rad", "°"])
@pytest.mark.parametrize("table_unit", ["deg", "rad"])
def test_limits_of_joints_have_units_of_their_own(unit: str, table_unit: str, tmp_path: Path) -> None:
    high = "1.5" if unit == "rad" else "85.943669269623"
    head = f"kind,theta [{table_unit}],d [m],a [m],alpha [{table_unit}],min [{unit}],max [{unit}]"
    out = str(tmp_path / "a.yaml")
    text = f"{head}\nturning,0,0,0.3,0,0,{high}\nrotary,0,0,0.3,0,0,{high}\n"
    assert main(["import", write(tmp_path, "dh.csv", text), "-o", out]) == 0
    joints = [e for e in sm.load_machine(out).description.legs[0].elements if getattr(e, "drive", None)]
    assert len(joints) == 2
    for element in joints:
        assert isinstance(element, Joint) and element.drive is not None
        np.testing.assert_allclose(element.drive.range, (0, 1.5))


@pytest.mark.parametrize(
    ("text", "asked"),
    [
        ("joint,theta [deg],d [mm],a [mm]\n1,0,0,0\n", "no column is alpha"),
        ("theta [deg],d,a [mm],alpha [deg]\n0,0,0,0\n", "say --unit d=mm"),
        ("name,theta [deg],d [mm],a [mm],alpha [deg]\nj,0,1,0,0\nj,0,1,0,90\n", "joints of the same name"),
        (
            "alpha_i-1 [deg],a_i-1 [mm],theta [deg],d_i [mm]\n0,0,0,0\n",
            "'alpha_i-1 [deg]', 'a_i-1 [mm]': of the link before its joint, which is the modified convention; say --dh-convention modified",
        ),
        ("alpha_j [deg],d_j [mm],theta_j [deg],r_j [mm]\n0,0,0,0\n", "say --dh-convention modified"),
        (
            "theta [deg],alpha [deg],r [mm],d [mm]\n0,0,0,0\n",
            "columns 'd' and 'r': one is the length along x",
        ),
        *((f"{title}\n{DH}\n0,0,1,0\n", f"'{title}': of the link before") for title in MODIFIED),
        *((f"{DH},{name}\n0,0,1,0,{v}\n", f"'{name}' says more than") for name, v in MORE),
        *(
            (f"{name},{DH}\n5,5,0,1,0\n", f"'{name}' and")
            for name in ("offset [deg]", "theta offset [rad]", "d [m]")
        ),
        *((f"type,{DH}\n{kind},0,0,1,0\n", f"found '{kind}'") for kind in ("fixed", "ball", "spherical")),
        *((f"theta [rad],d [m],a [m],alpha [rad],low,high\n{row}\n", "expected radians") for row in DEGREES),
    ],
)
def test_tables_of_joints_that_lack_something(
    text: str, asked: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["import", write(tmp_path, "dh.csv", text), "-o", str(tmp_path / "a.yaml")]) == 2
    assert asked in " ".join(capsys.readouterr().err.split())
    assert (
        main(["import", write(tmp_path, "dh.csv", table()), "--unit", "b=mm", "-o", str(tmp_path / "a.yaml")])
        == 2
    )
    assert "--unit b: expected one of theta, d, a, alpha" in capsys.readouterr().err
    poses, _, _ = session(tmp_path)
    assert main(["experiment", "new", poses, "-o", str(tmp_path / "e")]) == 2
    assert "either --machine or --dh" in capsys.readouterr().err


def imported(folder: Path, text: str, convention: str, *more: str) -> sm.Machine:
    out = str(folder / f"{convention}.yaml")
    file = write(folder, "arm.csv", text)
    assert main(["import", file, "--dh-convention", convention, *more, "-o", out]) == 0
    return sm.load_machine(out)


@pytest.mark.parametrize("standard", [True, False])
def test_slopes_of_a_table_are_central_differences(standard: bool) -> None:
    """The home of an arm is chosen by them."""
    rows = [
        dh.DHRow("a", 0.1, 0.3, -0.4, 1.2, False, None),
        dh.DHRow("b", 0.4, 0.2, 0.1, -0.7, True, None),
        dh.DHRow("c", -0.3, 0.0, 0.2, 0.5, False, None),
    ]
    q, reach = np.array([0.3, 0.15, -0.8]), 0.7
    found = dh._slopes(rows, standard, q, reach)

    def off(step: float) -> float:
        out = np.zeros((6, 3))
        for i in range(3):
            high, low = (dh.forward(rows, standard, q + s * step * np.eye(3)[i]) for s in (1, -1))
            turned = Rotation.from_matrix(high[:3, :3] @ low[:3, :3].T).as_rotvec()
            out[:, i] = np.r_[(high - low)[:3, 3] / reach, turned] / (2 * step)
        return float(np.abs(out - found).max())

    assert off(5e-3) < 1e-4
    assert np.log2(off(1e-2) / off(5e-3)) == pytest.approx(2, abs=0.05)


@pytest.fixture(scope="module")
def own_letters(tmp_path_factory: pytest.TempPathFactory) -> dict[str, sm.Machine]:
    """Of the letters that a table has otherwise, by convention."""
    folder = tmp_path_factory.mktemp("own")
    return {c: imported(folder, table(), c) for c in ("standard", "modified")}


@pytest.mark.parametrize(
    ("header", "order", "convention"),
    [
        ("alpha_j,d_j,theta_j,r_j", "alpha a theta d", "modified"),
        ("alpha(i-1),a(i-1),theta(i),d(i)", "alpha a theta d", "modified"),
        ("αᵢ₋₁,aᵢ₋₁,θᵢ,dᵢ", "alpha a theta d", "modified"),
        ("d,theta,r,alpha", "d theta a alpha", "standard"),
        ("theta,d,r,alpha", "theta d a alpha", "standard"),
        ("theta(i),d(i),a(i),alpha(i)", "theta d a alpha", "standard"),
    ],
)
def test_letters_of_several_books(
    header: str, order: str, convention: str, tmp_path: Path, own_letters: dict[str, sm.Machine]
) -> None:
    """Khalil's d is the length along x and his r the shift along z; Wikipedia's r is the length along x."""
    keys = order.split()
    rows = [dict(zip(("theta", "d", "a", "alpha"), r[1:], strict=True)) for r in UR10]
    text = "\n".join([header, *(",".join(str(r[k]) for k in keys) for r in rows)])
    units = [u for k in keys for u in ("--unit", _unit_of(k))]
    q = np.linspace(-0.5, 0.7, 6)
    one = sm.forward_kinematics(own_letters[convention], q)
    other = sm.forward_kinematics(imported(tmp_path, text, convention, *units), q)
    np.testing.assert_allclose(other.position, one.position, atol=1e-12)
    np.testing.assert_allclose(other.rotation, one.rotation, atol=1e-12)


def _unit_of(key: str) -> str:
    """Of a column by the name that the table of Denavit and Hartenberg gives it."""
    return f"{key}={'deg' if key in ('theta', 'alpha') else 'mm'}"


def test_gauges_that_say_target_minus_actual(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = write(tmp_path, "t.csv", "x [mm],y [mm],z [mm],dx 1 [um],dx 2 [um]\n0,416,0,5,7\n")
    arguments = ["experiment", "new", file, "--machine", "five-bar", "--quantity", "position"]
    assert main([*arguments, "-o", str(tmp_path / "e"), "--difference", "target-minus-actual"]) == 0
    assert "less dx" in capsys.readouterr().out
    file = write(tmp_path, "p.csv", "x [mm],y [mm],z [mm],px [mm],py [mm],pz [mm]\n0,416,0,0,416,0\n")
    arguments = ["experiment", "new", file, "--machine", "five-bar", "--quantity", "position"]
    assert main([*arguments, "-o", str(tmp_path / "f"), "--difference", "target-minus-actual"]) == 2
    assert "--difference: no column is a difference" in capsys.readouterr().err
    assert sm.load_experiment(tmp_path / "e").reading[:, 0] == pytest.approx([-5e-6, -7e-6])


@pytest.mark.parametrize(
    ("text", "convention"),
    [
        ("i,a [mm],alpha [deg],d [mm],theta [deg]\n1,225,0,100,q1\n2,175,180,0,θ2 - 90\n3,0,0,d3,30\n4,0,0,10,90 + \\theta_4\n", "standard"),
        ("i,a [mm],alpha [deg],d [mm],theta_offset_i [deg],type\n1,225,0,100,0*,R\n2,175,180,0,-90,R\n3,0,0,q3,30,P\n4,0,0,10,+90,R\n", "standard"),
        ("| i | $\\alpha_{i-1}$ [deg] | $a_{i-1}$ [mm] | $\\theta_i$ [deg] | $d_i$ [mm] |\n|--|--|--|--|--|\n| 1 | 0 | 0 | \\theta_1 | 100 |\n"
         "| 2 | 0 | 225 | −90+θ_2 | 0 |\n| 3 | 180 | 175 | 30 | d_3 |\n| 4 | 0 | 0 | 90+θ4* | 10 |\n", "modified"),
    ],
)  # fmt: skip
def test_the_coordinate_of_a_joint_stands_in_its_cell(text: str, convention: str, tmp_path: Path) -> None:
    (tmp_path / "dh.csv").write_text(text, encoding="utf-8")
    rows = read_dh(read_sheet(tmp_path / "dh.csv"), {}, convention)
    assert [r.slides for r in rows] == [False, False, True, False]
    assert [math.degrees(r.theta) for r in rows] == pytest.approx([0, -90, 30, 90])
    assert [r.d for r in rows] == pytest.approx([0.1, 0, 0, 0.01])


@pytest.mark.parametrize("cell", ["180 - q2", "-q2", "2*q2", "q2 + q3", "d2"])
def test_a_coordinate_that_is_not_simply_added_is_refused(cell: str, tmp_path: Path) -> None:
    (tmp_path / "dh.csv").write_text(f"i,a [mm],alpha [deg],d [mm],theta [deg]\n1,2,0,1,0\n2,1,0,0,{cell}\n")
    with pytest.raises(StiffmapError, match=r"column .theta.*expected a number"):
        read_dh(read_sheet(tmp_path / "dh.csv"), {}, "standard")


SCARA = "joint,theta [deg],d [mm],a [mm],alpha [deg],type\njoint_1,0,0,400,0,R\njoint_2,0,0,350,0,R\nlift,0,0,0,0,P\n"


@pytest.mark.parametrize(
    ("columns", "same"),
    [
        ("q2,q3", {"joint_1": 0.0}),
        ("q1,q3", {"J2": 0.0}),
        ("joint_1,joint_2", {"lift": 12.5}),
        ("q1,q2", {"q0": 0.0}),
        ("q3", {"arm.joint_1": 0.0, "q2": 0.0}),
    ],
)
def test_a_joint_may_be_the_same_in_every_row(columns: str, same: dict[str, float], tmp_path: Path) -> None:
    """Angles of zero need no unit, lengths are mm; the noise of places goes by the names of their columns."""
    rows = [f"{','.join(f'{k + 0.1 * j}' for j in range(columns.count(',') + 1))},{k},2,3" for k in range(3)]
    (tmp_path / "t.csv").write_text("\n".join([f"{columns},px [mm],py [mm],pz [mm]", *rows]) + "\n")
    write(tmp_path, "dh.csv", SCARA)
    units = {c: "mm" if c == "q3" or (c, "q0") == ("q2", *same) else "deg" for c in columns.split(",")}
    noise = {"px": 0.1, "py": 0.2, "pz": 0.3}
    made = sm.experiment_from_table(
        None,
        tmp_path / "t.csv",
        tmp_path / "o",
        dh=tmp_path / "dh.csv",
        units=units,
        constants=same,
        noise=noise,
    )
    np.testing.assert_allclose(made.experiment.sigma[:, :3], [[1e-4, 2e-4, 3e-4]] * 3)
    command = made.experiment.command
    assert command is not None
    order = [c.joint for c in made.experiment.command_of]
    for name, value in same.items():
        joint = {"J2": "arm.joint_2", "q2": "arm.joint_2", "lift": "arm.lift"}.get(name, "arm.joint_1")
        np.testing.assert_allclose(command[:, order.index(joint)], 1e-3 * value, atol=1e-15)


def test_a_joint_that_is_set_next_to_its_column_is_refused(tmp_path: Path) -> None:
    write(tmp_path, "dh.csv", SCARA)
    write(tmp_path, "t.csv", "q1,q2,q3,px [mm]\n1,2,3,4\n2,3,4,5\n")
    units, noise = {"q1": "deg", "q2": "deg", "q3": "mm"}, {"px": 0.1}
    for same in ({"joint_1": 0.0}, {"q1": 0.0}, {"q7": 0.0}):
        with pytest.raises(StiffmapError, match=next(iter(same))):
            sm.experiment_from_table(
                None, tmp_path / "t.csv", tmp_path / "o", dh=tmp_path / "dh.csv", units=units, constants=same, noise=noise
            )  # fmt: skip


@pytest.mark.parametrize(
    ("text", "theta"),
    [
        ("| Joint | theta [deg] | d [mm] | a [mm] | alpha [deg] |\n|---|:---:|---|---|---|\n| 1 | 90 + q1 | 300 | 0 | 90 |\n| 2 | q2 | 0 | 400 | 0 |\n", 90.0),
        ("# My arm\n\n| i | $\\theta_i$ [deg] | d_i [mm] | a_i [mm] | $\\alpha_i$ [deg] |\n|-|-|-|-|-|\n| 1 | \\theta_1 - 30 | 300 | 0 | 90 |\n| 2 | $\\theta_2$ | 0 | 400 | 0 |\n", -30.0),
        ("| Link | θ [°] | d [mm] | a [mm] | α [°] |\n|--|--|--|--|--|\n| 1 | θ₁ + 15 | 300 | 0 | 90° |\n| 2 | θ₂ | 0 | 400 | 0° |\n", 15.0),
        ("Link | theta (deg) | d (mm) | a (mm) | alpha (deg)\n--- | --- | --- | --- | ---\n1 | 45 + q1 | 300 | 0 | 90\n2 | q2 | 0 | 400 | 0\n", 45.0),
    ],
)  # fmt: skip
def test_tables_of_markdown_are_imported(text: str, theta: float, tmp_path: Path) -> None:
    assert main(["import", write(tmp_path, "arm.md", text), "-o", str(tmp_path / "arm.yaml")]) == 0
    assert [r.theta for r in read_dh(read_sheet(tmp_path / "arm.md"), {}, "standard")] == pytest.approx(
        [math.radians(theta), 0.0]
    )


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("dh.csv", "joint,theta,d [mm],a [mm],alpha\n1,0,300,0,pi/2\n2,-π/2,0,400,0\n3,30°,0,0,-90°\n"),
        ("dh.csv", "joint;theta [deg];d [mm];a [mm];alpha [rad]\n1;0;300;0;1,5707963268\n2;-np.pi/2;0;400;0\n3;30;0;0;-2*pi/4\n"),
        ("dh.md", "| Link | &theta;<sub>i</sub> | d<sub>i</sub> (mm) | a<sub>i</sub> (mm) | α<sub>i</sub> |\n|-|-|-|-|-|\n"
         "| 1 | θ<sub>1</sub> | 300 | 0 | π/2 |\n| 2 | θ<sub>2</sub> − π/2 | 0 | 400 | 0 |\n| 3 | **θ₃ + π/6** | 0 | 0 | −π/2 |\n"),
        ("dh.tex", "\\begin{tabular}{|c|c|c|c|c|}\n\\hline\n$i$ & $\\theta_i$ & $d_i$ [mm] & $a_i$ [mm] & $\\alpha_i$ \\\\ \\hline\n"
         "1 & $\\theta_1$ & 300 & 0 & $\\frac{\\pi}{2}$ \\\\\n2 & $\\theta_2-\\pi/2$ & 0 & 400 & 0 \\\\[2pt]\n\\midrule 3 & $\\theta_3 + 30^\\circ$ & 0 & 0 & $-90^{\\circ}$ \\\\ \\hline\n\\end{tabular}\n"),
    ],
)  # fmt: skip
def test_angles_of_parts_of_pi_and_marks_of_texts(name: str, text: str, tmp_path: Path) -> None:
    file = write(tmp_path, name, text)
    assert main(["import", file, "-o", str(tmp_path / "arm.yaml")]) == 0
    rows = read_dh(read_sheet(Path(file)), {}, "standard")
    assert [math.degrees(r.theta) for r in rows] == pytest.approx([0, -90, 30])
    assert [math.degrees(r.alpha) for r in rows] == pytest.approx([90, 0, -90])
    assert [(r.d, r.a) for r in rows] == [(0.3, 0), (0, 0.4), (0, 0)]


def _cells(folder: Path, theta: str, d: str) -> list[str]:
    rows = f"1,0,{d},0,pi/2\n2,{theta},0.1,0.43,0\n"
    return ["import", write(folder, "dh.csv", f"joint,theta [rad],d [m],a [m],alpha\n{rows}"), "--overwrite"]


@pytest.mark.parametrize(
    ("theta", "d", "turn", "shift"),
    [
        ("1/2*pi", "0.33 + 0.42", 0.5, 0.75),
        ("pi/2 + pi", "2*0.15", 1.5, 0.3),
        ("90° + 45°", "2 \\cdot 0.15", 0.75, 0.3),
        ("-\\frac{1}{2}\\pi", "(0.1+0.2)*2", -0.5, 0.6),
        ("2π/4", "1e-1+1e-2", 0.5, 0.11),
    ],
)
def test_cells_that_are_sums_and_products(
    theta: str, d: str, turn: float, shift: float, tmp_path: Path
) -> None:
    rows = read_dh(read_sheet(Path(_cells(tmp_path, theta, d)[1])), {}, "standard")
    assert (rows[1].theta / math.pi, rows[0].d) == pytest.approx((turn, shift))


def test_sums_with_decimal_commas(tmp_path: Path) -> None:
    text = "joint;theta [deg];d [m];a [m];alpha\n1;90 + 1,125;0,33 + 0,42;0;0\n2;1,125°;0,5;0;-π/2\n"
    rows = read_dh(read_sheet(Path(write(tmp_path, "dh.csv", text))), {}, "standard")
    assert [math.degrees(r.theta) for r in rows] == pytest.approx([91.125, 1.125])
    assert [r.d for r in rows] == pytest.approx([0.75, 0.5])


@pytest.mark.parametrize(
    ("theta", "d", "words"),
    [
        ("0 \\to 1", "0", "line 3: 'theta.*expected one number; found '0 .*to 1', a range"),
        ("−170–170", "0", "line 3: 'theta.*expected one number.*a range or a difference"),
        ("0", "0...1", "line 2: 'd .*expected one number.*limits of a joint stand in columns low and high"),
        ("0", "2**3", "line 2: column 'd .*expected a number"),
        ("0", "1/0*2", "line 2: column 'd .*expected a number"),
        ("0", "90°", "line 2: column 'd .*expected a number"),
    ],
)
def test_cells_that_are_no_one_number_are_refused(theta: str, d: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(StiffmapError, match=words):
        read_dh(read_sheet(Path(_cells(tmp_path, theta, d)[1])), {}, "standard")


@pytest.mark.parametrize("first", [True, False])
def test_joints_in_small_letters_next_to_quaternions_in_capitals(first: bool, tmp_path: Path) -> None:
    turns, joints = [f"Q{i}" for i in range(4)], [f"q{i} [deg]" for i in range(1, 7)]
    names = [*joints, *turns] if first else [*turns, *joints]
    rows = [
        {**dict(zip(joints, (10.0 * k + i for i in range(6)), strict=True)), **dict(zip(turns, (0.6, 0, 0.8, 0), strict=True))}
        for k in range(4)
    ]  # fmt: skip
    lines = [",".join(str(r[n]) for n in names) + f",{k},2,3" for k, r in enumerate(rows)]
    text = "\n".join([",".join([*names, "px [mm]", "py [mm]", "pz [mm]"]), *lines])
    dh = write(tmp_path, "dh.csv", table())
    noise = {"px": 1.0, "py": 1.0, "pz": 1.0}
    sm.experiment_from_table(None, write(tmp_path, "t.csv", text), tmp_path / "o", dh=dh, noise=noise)
    command = sm.load_experiment(tmp_path / "o").command
    assert np.degrees(command[3]) == pytest.approx([30, 31, 32, 33, 34, 35])


def test_names_in_words_and_limits_of_coordinates(tmp_path: Path) -> None:
    head = "Link,Link length a (mm),Link twist α (deg),Link offset d (mm),Joint angle θ (deg),qmin,q_max"
    file = write(tmp_path, "dh.csv", f"{head}\n1,30,90,400,q1,-170,170\n2,500,-,,q2 + 90,-90,120\n")
    rows = read_dh(read_sheet(Path(file)), {}, "standard")
    assert [v for r in rows for v in (r.a, math.degrees(r.alpha), r.d)] == pytest.approx(
        [0.03, 90, 0.4, 0.5, 0, 0]
    )
    assert [math.degrees(r.theta) for r in rows] == pytest.approx([0, 90])
    assert [float(np.degrees(v)) for r in rows for v in r.range or ()] == pytest.approx([-170, 170, -90, 120])


def test_columns_that_nothing_is_made_of_are_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = table().replace("alpha [deg]\n", "alpha [deg],Mass [kg]\n").replace("90.0\n", "90.0,7.1\n")
    assert main(["import", write(tmp_path, "dh.csv", text), "-o", str(tmp_path / "arm.yaml")]) == 0
    assert "left out: column 'Mass [kg]'" in capsys.readouterr().out


@pytest.mark.parametrize("cell", ["#REF!", "?", "n/a", "missing"])
def test_a_cell_that_lacks_its_number_is_no_zero(cell: str, tmp_path: Path) -> None:
    rows = f"1,0,400,0,{cell}\n2,0,0,500,0\n"
    file = write(tmp_path, "dh.csv", f"joint,theta [deg],d [mm],a [mm],alpha [deg]\n{rows}")
    with pytest.raises(StiffmapError, match=r"line 2: 'alpha .deg.': expected one number; found"):
        read_dh(read_sheet(Path(file)), {}, "standard")


def test_a_convention_that_nobody_says_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = _cells(tmp_path, "0", "0.1")
    assert main(given) == 0
    assert "standard was taken; --dh-convention modified takes the other" in capsys.readouterr().out
    assert main([*given, "--dh-convention", "standard"]) == 0
    assert "was taken" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ("1,0,0\n3,0,0\n2,0,0", "line 4: expected joints in their order"),
        ("joint_2,0,0\njoint_1,0,0", "line 3: expected joints in their order"),
        ("1->2,0,0\n0->1,0,0", "line 3: expected joints in their order"),
        ("1,q1,0\n2,q2 + 90,0\n3,0,100", "line 4: no joint's coordinate"),
        ("1,q1,0\ntool,0,100\n2,q2,0", "line 3: no joint's coordinate"),
        ("tool,0,100\nflange,0,10", "line 2: a name that no joint has"),
        ("base,0,200\n1,q1,0", "line 2: no joint's coordinate"),
        (
            "1,0,0\n2,0,0\nTool flange,0,100",
            "line 4: a name that no joint has: write the joints' theta as q1",
        ),
    ],
)
def test_rows_that_are_no_joints_one_behind_the_other_are_refused(
    rows: str, words: str, tmp_path: Path
) -> None:
    lines = "\n".join(f"{r},10,0" for r in rows.split("\n"))
    file = write(tmp_path, "dh.csv", f"joint,theta [deg],d [mm],a [mm],alpha [deg]\n{lines}\n")
    with pytest.raises(StiffmapError, match=words):
        read_dh(read_sheet(Path(file)), {}, "standard")


@pytest.mark.parametrize("convention", ["standard", "modified"])
@pytest.mark.parametrize(
    ("thetas", "sliding", "tool"),
    [
        (("θ1", "θ2 - 90"), "0", ["Flange,0,107,20,30"]),
        (("θ1*", "q2-90"), "0", ["TCP,90,100,-5,0"]),
        (("q1", "0"), "q2", ["flansch,0,50,0,0", "Werkzeug,45,0,100,90"]),
    ],
)
def test_a_tool_behind_the_last_joint_stays(
    thetas: tuple[str, str], sliding: str, tool: list[str], convention: str, tmp_path: Path
) -> None:
    head = "joint,theta [deg],d [mm],a [mm],alpha [deg]"
    lines = [f"1,{thetas[0]},400,25,-90", f"2,{thetas[1]},{sliding},560,0"]
    q = np.array([0.3, 0.7])
    whole, bare = (
        sm.forward_kinematics(imported(tmp_path, "\n".join([head, *t]), convention, "--overwrite"), q)
        for t in ([*lines, *tool], lines)
    )
    expected = np.eye(4)
    expected[:3, :3], expected[:3, 3] = bare.rotation, bare.position
    for line in tool:
        theta, d, a, alpha = (float(v) for v in line.split(",")[1:])
        own, link = turn_z(np.radians(theta), 1e-3 * d), turn_x(np.radians(alpha), 1e-3 * a)
        expected = expected @ (own @ link if convention == "standard" else link @ own)
    np.testing.assert_allclose(whole.position, expected[:3, 3], atol=1e-12)
    np.testing.assert_allclose(whole.rotation, expected[:3, :3], atol=1e-12)


@pytest.mark.parametrize(
    "form",
    [
        "/joint_states/joint_{}/position", "field.position{}", "joint_states.position.joint_{}", ".position[{}]",
        "joint[{}]", "θ{}", "/states/position[joint_{}]",
    ],
)  # fmt: skip
def test_joints_have_the_names_that_logs_give_them(form: str, tmp_path: Path) -> None:
    first = int("osition" in form and "joint_" not in form) ^ 1  # an array begins at 0
    rows = [f"{k},{0.1 * k + 0.05},{-0.2 * k},{0.01 * k},{k},2,3,9" for k in range(3)]
    names = [form.format(k + first) for k in range(3)]
    head = ",".join(
        [
            "t",
            *names,
            "px [mm]",
            "py [mm]",
            "pz [mm]",
            form.format(1).replace("position", "velocity") if "position" in form else "more",
        ]
    )
    (tmp_path / "t.csv").write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    write(tmp_path, "dh.csv", SCARA)
    made = sm.experiment_from_table(
        None, tmp_path / "t.csv", tmp_path / "o", dh=tmp_path / "dh.csv", units={"angle": "rad", "length": "m"}, noise={"px": 0.1, "py": 0.1, "pz": 0.1}
    )  # fmt: skip
    expected = [[0.1 * k + 0.05, -0.2 * k, 0.01 * k] for k in range(3)]
    np.testing.assert_allclose(made.experiment.command, expected, atol=1e-12)


def test_two_logs_of_one_joint_are_asked_for(tmp_path: Path) -> None:
    write(tmp_path, "dh.csv", SCARA)
    head = ",".join(f"/{who}/joint_{k}/position" for who in ("target", "state") for k in (1, 2, 3))
    (tmp_path / "t.csv").write_text(f"{head},px [mm]\n1,2,3,1,2,3,4\n2,3,4,1,2,3,5\n")
    units, noise = {"angle": "rad", "length": "m"}, {"px": 0.1}
    with pytest.raises(StiffmapError, match=r"which of two columns commands arm\.joint_1\?"):
        sm.experiment_from_table(
            None, tmp_path / "t.csv", tmp_path / "o", dh=tmp_path / "dh.csv", units=units, noise=noise
        )


def of_log(tmp_path: Path, head: str, rows: np.ndarray, *columns: str) -> sm.FromTable:
    sep = next(c for c in ",; " if c in head)
    text = "\n".join([head, *(sep.join(f"{v:.6g}" for v in row) for row in rows)])
    (tmp_path / "t.csv").write_text(text, encoding="utf-8")
    said = dict(c.split("=") for c in columns)
    noise = {"px": 0.1, "py": 0.1, "pz": 0.1}
    return sm.experiment_from_table(
        "ur10", tmp_path / "t.csv", tmp_path / "o", columns=said, noise=noise, overwrite=True
    )


LOGGED = np.round(np.sin(np.arange(4 * 9).reshape(4, 9) ** 2), 4)
PLACES = "px [mm],py [mm],pz [mm]"


@pytest.mark.parametrize(
    ("form", "scale"),
    [
        ("field.position{0}", 1.0),
        ("joint_states.position[{0}]", 1.0),
        ("actual_q_{0}", 1.0),
        ("rax_{1} [deg]", 180 / math.pi),
        ("Ist-Position A{1} [°]", 180 / math.pi),
        ("ROB_1 Axis {1} Position [deg]", 180 / math.pi),
    ],
)
def test_logs_of_controllers_have_joints_in_their_own_units(form: str, scale: float, tmp_path: Path) -> None:
    """ROS and RTDE are in SI by their format, which is said."""
    head = ",".join([*(form.format(k, k + 1) for k in range(6)), PLACES])
    found = of_log(tmp_path, head, LOGGED * ([scale] * 6 + [1.0] * 3))
    np.testing.assert_allclose(found.experiment.command, LOGGED[:, :6], atol=1e-6)
    assert any("is in rad, as such logs are" in r for r in found.remarks) == (scale == 1.0)


def test_a_message_says_whose_its_numbers_are(tmp_path: Path) -> None:
    """Where its joints come in another order than the drives, by their names or not at all."""
    names = [
        "elbow_joint",
        "shoulder_lift_joint",
        "shoulder_pan_joint",
        *(f"wrist_{k}_joint" for k in (1, 2, 3)),
    ]
    heads = [*(f"field.name{k}" for k in range(6)), *(f"field.position{k}" for k in range(6)), PLACES]

    def read(words: list[list[str]], *columns: str) -> sm.FromTable:
        numbers = np.column_stack([LOGGED[:, : len(words[0]) - 6], LOGGED])
        rows = [[*w, *map(str, r)] for w, r in zip(words, numbers, strict=True)]
        text = "\n".join(map(",".join, [heads, *rows]))
        file = write(tmp_path, "t.csv", text)
        return sm.experiment_from_table(
            "ur10", file, tmp_path / "o", columns=dict(c.split("=") for c in columns), overwrite=True
        )

    with pytest.raises(
        StiffmapError, match=r"commands arm.base \(the table names elbow_joint in 'field.position0'"
    ):
        read([names] * 4)
    with pytest.raises(
        StiffmapError, match=r"line 5: 'field\.name0': expected the joint elbow_joint in all rows"
    ):
        read([*[names] * 3, names[::-1]])
    found = read([names] * 4, "base=field.position2", "shoulder=field.position1").experiment
    np.testing.assert_allclose(found.command, LOGGED[:, [2, 1, 0, 3, 4, 5]])
    known = read([[n.replace("_lift", "").replace("shoulder_pan", "base") for n in names]] * 4).experiment
    np.testing.assert_allclose(known.command, found.command)
    arm_, gripper = (
        ["base", "shoulder", "elbow", *names[3:]],
        ["finger_joint"],
    )  # which is no drive of the arm
    heads[:] = [*(f"field.name{k}" for k in range(7)), *(f"field.position{k}" for k in range(7)), PLACES]
    for words, drives in ((gripper + arm_, [0, 1, 2, 3, 4, 5]), (arm_ + gripper, [0, 0, 1, 2, 3, 4])):
        np.testing.assert_allclose(read([words] * 4).experiment.command, LOGGED[:, drives])


def test_places_of_messages_are_in_metres_and_asked_for_next_to_joints(tmp_path: Path) -> None:
    head = ",".join(
        [*(f"/joint_states/position[{k}]" for k in range(6)), *(f"/leica/pose/position/{a}" for a in "xyz")]
    )
    with pytest.raises(StiffmapError, match="say --map px='/leica/pose/position/x'"):
        of_log(tmp_path, head, LOGGED)
    found = of_log(tmp_path, head, LOGGED, *(f"p{a}=/leica/pose/position/{a}" for a in "xyz"))
    np.testing.assert_allclose(found.experiment.seen, LOGGED[:, 6:])


def test_a_pose_of_a_log_is_commanded_with_its_orientation(tmp_path: Path) -> None:
    """Also next to places that were seen."""
    head = " ".join([*(f"target_TCP_pose_{k}" for k in range(6)), "px_mm py_mm pz_mm"])
    found = of_log(tmp_path, head, LOGGED).experiment
    np.testing.assert_allclose(found.position, LOGGED[:, :3], atol=1e-12)
    assert found.rotation is not None
    np.testing.assert_allclose(found.rotation, Rotation.from_rotvec(LOGGED[:, 3:6]).as_matrix(), atol=1e-12)
    turned = Rotation.from_rotvec(LOGGED[:, 3:6])
    parts = [*(f"/robot/pose/position/{a}" for a in "xyz"), *(f"/robot/pose/orientation/{a}" for a in "xyzw")]
    rows = np.column_stack([LOGGED[:, :3], turned.as_quat(), LOGGED[:, 6:]])
    found = of_log(tmp_path, ",".join([*parts, PLACES]), rows).experiment
    assert found.rotation is not None
    np.testing.assert_allclose(found.rotation, turned.as_matrix(), atol=1e-5)


def test_a_controllers_own_pose_next_to_joints_is_a_note(tmp_path: Path) -> None:
    """And joints that cannot be radians are degrees, also in a log that has radians by its format."""
    heads = [
        *(f"actual_q_{k}" for k in range(6)),
        *(f"{a} [mm]" for a in "XYZ"),
        "A [deg],B [deg],C [deg]",
        PLACES,
    ]
    rows = np.column_stack([90 * LOGGED[:, :6], 500 * LOGGED[:, :6], 1e3 * LOGGED[:, 6:]])
    found = of_log(tmp_path, ",".join(heads), rows).experiment
    np.testing.assert_allclose(found.command, np.radians(90 * LOGGED[:, :6]), atol=1e-6)
    assert found.rotation is None and found.seen is not None


@pytest.mark.parametrize(
    ("names", "row"),
    [
        (["joint {k} [rad]", "measured {a} [mm]"], None),
        (["j{k} [rad]", "Tracker {a} [mm]"], None),
        (["joints [rad]", "SMR [mm]"], '"{q}","{p}"'),
        (["joint_positions [rad]", "Measured position [mm]"], '"{q}","{p}"'),
    ],
)
def test_positions_next_to_joints_are_those_of_the_instrument_that_names_them(
    names: list[str], row: str | None, tmp_path: Path
) -> None:
    """Also as lists in single cells."""
    machine = sm.load_machine("ur10")
    home = sm.inverse_kinematics(machine, machine.description.home.p).actuators
    q = home + np.random.default_rng(3).uniform(-0.3, 0.3, (12, 6))
    p = sm.forward_kinematics(machine, q).position * 1e3
    if row is None:
        head = [names[0].format(k=k + 1) for k in range(6)] + [names[1].format(a=a) for a in "xyz"]
        rows = [",".join(map(repr, [*a.tolist(), *b.tolist()])) for a, b in zip(q, p, strict=True)]
    else:
        head = names
        rows = [row.format(q=a.tolist(), p=tuple(b.tolist())) for a, b in zip(q, p, strict=True)]
    (tmp_path / "t.csv").write_text("\n".join([",".join(head), *rows]) + "\n")
    noise = ["--noise", "dx=0.01", "--noise", "dy=0.01", "--noise", "dz=0.01"]
    out = tmp_path / "e"
    assert (
        main(["experiment", "new", str(tmp_path / "t.csv"), "--machine", "ur10", "-o", str(out), *noise]) == 0
    )
    found = sm.load_experiment(out)
    assert found.command == pytest.approx(q, abs=1e-12)
    assert found.seen is not None and (found.frame, found.tool) == ("unknown", "unknown")
    assert 1e3 * found.seen == pytest.approx(p, abs=1e-9)
