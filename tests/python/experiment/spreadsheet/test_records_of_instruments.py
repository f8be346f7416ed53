"""Tables as tracking systems, controllers and measuring programs write them: what would be a wrong number is read or refused."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import stiffmap as sm
from stiffmap.common.errors import StiffmapError

HEAD = "x [mm];y [mm];z [mm];fz [N];dz [µm]\n"
ROWS = "0;0;0;-100;-41\n50;0;0;-200;-83\n"
COMMANDS = ("0.016", "-0.416", "1.072", "-1.466", "-1.834", "-0.107")
LOAD = {"fz": -100.0}


@pytest.fixture(autouse=True)
def own_profiles(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))


def made(
    folder: Path, text: str, machine: str = "orthoglide-revised", **more: Mapping[str, Any]
) -> sm.FromTable:
    file = folder / "record.csv"
    file.write_text(text, encoding="utf-8")
    return sm.experiment_from_table(machine, file, folder / "e", **more)  # type: ignore[arg-type]


def truth(e: sm.Experiment) -> None:
    np.testing.assert_allclose(e.position, [[0, 0, 0], [0.05, 0, 0]])
    np.testing.assert_allclose(e.wrench[:, 2], [-100, -200])
    np.testing.assert_allclose(e.reading[:, 2], [-41e-6, -83e-6])


@pytest.mark.parametrize(
    "remark", ["Tool length: 120 mm", "# Facet size: 19 mm", "Payload, 5 kg", "Units: mm, N"]
)
def test_a_size_above_the_table_is_no_unit_of_its_columns(remark: str, tmp_path: Path) -> None:
    text = f"{remark}\nx;y;z;dz;fz [N]\n1;2;3;0.101;-250\n1.1;2;3;0.102;-250\n"
    e = made(tmp_path, text, units={"length": "in"}).experiment
    np.testing.assert_allclose(e.position[0], np.array([1, 2, 3]) * 0.0254)


@pytest.mark.parametrize("title", ["Test in mm", "Units: mm", "All lengths [mm]"])
def test_a_unit_above_the_table_still_is(title: str, tmp_path: Path) -> None:
    e = made(tmp_path, f"{title}\nx;y;z;dz;fz [N]\n1;2;3;0.101;-250\n1.1;2;3;0.102;-250\n").experiment
    np.testing.assert_allclose(e.position[0], [1e-3, 2e-3, 3e-3])


@pytest.mark.parametrize("fixed", [False, True])
@pytest.mark.parametrize(
    "names", ["Rotation {}", "field.pose.orientation.{}", ".pose.orientation.{}", "quat_{}", "Q{}"]
)
def test_quaternions_are_no_rotations(names: str, fixed: bool, tmp_path: Path) -> None:
    """Motive, ROS, Polaris: their x, y, z are half angles, which degrees would make wrong in silence."""
    turns = ";".join("Q0" if names == "Q{}" and a == "W" else names.format(a) for a in "XYZW")
    places, cells = ("", "") if fixed else ("x [mm];y [mm];z [mm];", "1;2;3;")
    at = {"x": 1.0, "y": 2.0, "z": 3.0} if fixed else {}
    text = f"{places}{turns};dx [mm]\n{cells}0;0;0.1;0.994987;0.1\n{cells}0;0;0.1;0.994987;0.1\n"
    e = made(tmp_path, text, constants={**LOAD, **at}).experiment
    assert np.isnan(e.reading[:, 3:]).all()
    head = (tmp_path / "e" / "data.csv").read_text().splitlines()[0].split(",")
    assert {"qw", "qx", "qy", "qz"} <= {*head}


@pytest.mark.parametrize(
    "names",
    [
        "Begin {0};End {0};Écart {0}",
        "{0} nom;{0} mes;Ecart {0}",
        "{0} nominal;{0} mesuré;Comparateur {0}",
        "{0};Comparateur {0} avant;Comparateur {0} après",
        "{0};Clock {0} prima;Clock {0} dopo",
    ],
)
def test_words_of_other_programs_and_languages(names: str, tmp_path: Path) -> None:
    heads = [h for a in "XYZ" for h in names.format(a).split(";")]
    cells = "0;-41;-41" if "nom" in names or "Begin" in names else "0;2;-39"
    text = f"{';'.join(f'{h} [µm]' for h in heads)}\n" + f"{';'.join([cells] * 3)}\n" * 2
    e = made(tmp_path, text, constants=LOAD).experiment
    np.testing.assert_allclose(e.reading[0, :3], -41e-6)
    np.testing.assert_allclose(e.position, 0.0)


@pytest.mark.parametrize("names", ["q_{}", "joint{}", "target_q_{}", "actual_q_{}"])
@pytest.mark.parametrize("first", [0, 1])
def test_joints_are_counted_from_where_they_begin(names: str, first: int, tmp_path: Path) -> None:
    header = " ".join(names.format(k + first) for k in range(6))
    row = " ".join(COMMANDS)
    text = f"clock {header} px py pz\n1 {row} 1400.1 200.2 300.3\n2 {row} 1400.1 200.2 300.3\n"
    made(tmp_path, text, machine="ur10", units={"joints": "rad", "length": "mm"})
    data = (tmp_path / "e" / "data.csv").read_text().splitlines()
    assert data[0].startswith("q1,q2,q3,q4,q5,q6,px")
    assert data[1].split(",")[:6] == list(COMMANDS)


@pytest.mark.parametrize(
    "loads", ["dz 50 [µm];dz 100 [µm]", "dz 0 [µm];dz 50 [µm]", "dz 2;dz 5", "50 N;100 N"]
)
def test_columns_of_several_loads_are_no_repeats(loads: str, tmp_path: Path) -> None:
    chosen = {"dz": loads.replace(";", "|")} if loads[0] != "d" else {}
    with pytest.raises(StiffmapError, match=r"no repeats.*a row for each one with the load in a column"):
        made(tmp_path, f"x [mm];y [mm];z [mm];{loads}\n0;0;0;-41;-83\n50;0;0;-45;-90\n", constants=LOAD,
             columns=chosen, units={"dz": "um"})  # fmt: skip


@pytest.mark.parametrize("cell", ["-0.041", "0.125", "00.500"])
def test_a_number_that_begins_with_zero_is_no_thousand(cell: str, tmp_path: Path) -> None:
    """Next to a decimal comma it was taken as -41, 125, 500."""
    with pytest.raises(StiffmapError, match=r"line 3: column 'x \[mm\]': expected a number; found '50,0'"):
        made(tmp_path, f"{HEAD}0;0;0;-100;{cell}\n50,0;0;0;-200;-83\n")


@pytest.mark.parametrize(
    "word", ["Gesamtmittel", "Overall mean", "Grand total", "x̄", "Max-Min", "Max. – Min."]
)
def test_what_programs_compute_below_is_no_reading(word: str, tmp_path: Path) -> None:
    found = made(
        tmp_path, f"Nr;{HEAD}A;{ROWS.splitlines()[0]}\nB;{ROWS.splitlines()[1]}\n{word};0;0;0;-150;-62\n"
    )
    truth(found.experiment)
    assert found.remarks == (f"left out: row 4, '{word}', is no reading",)


@pytest.mark.parametrize(
    ("above", "lines"),
    [
        ("Channels;3;;;\nSamples;2;2;2;\nX_Dimension;Time;Time;Time;\nX0;0.0;0.0;0.0;\nDelta_X;0.1;0.1;0.1;\n", (2, 4, 5)),
        ("Base;Base;Base;Load;Tool\n1;1;1;2;3\n", (2,)),
        ("Serial;Serial;Serial;Serial;Serial\n4711;4712;4713;4714;4715\n;;;;\n", (2,)),
    ],
)  # fmt: skip
def test_numbers_above_the_header_are_no_readings(above: str, lines: tuple[int, ...], tmp_path: Path) -> None:
    found = made(tmp_path, above + HEAD + ROWS)
    truth(found.experiment)
    assert found.remarks == tuple(f"left out: row {n}, of numbers above the header" for n in lines)


@pytest.mark.parametrize(
    "head",
    [
        "x [mm];y [mm];z [mm];fz [N];dz [µm];;\n",
        "x [mm];y [mm];z [mm];fz [N];dz [µm];;\n;;;;1;2;3\n",
        "x [mm];y [mm];z [mm];fz [N];dz [µm];;\n;;;;Run 1;Run 2;Run 3\n",
        "x;y;z;fz;dz;;\nmm;mm;mm;N;µm;µm;µm\n;;;;1;2;3\n",
    ],
)
def test_a_header_holds_for_the_columns_behind_it_that_have_none(head: str, tmp_path: Path) -> None:
    e = made(tmp_path, head + "0;0;0;-100;-41;-42;-43\n50;0;0;-200;-83;-84;-85\n").experiment
    np.testing.assert_allclose(e.reading[:, 2], 1e-6 * np.array([-41, -42, -43, -83, -84, -85]))
    np.testing.assert_allclose(e.wrench[:, 2], [-100] * 3 + [-200] * 3)


@pytest.mark.parametrize(
    "names",
    [
        "Channel 1 Fx [N];Channel 2 Fy [N];Channel 3 Fz [N]",
        "CH1: Fx (N);CH2: Fy (N);CH3: Fz (N)",
        "Dev1/ai0_Fx [N];Dev1/ai1_Fy [N];Dev1/ai2_Fz [N]",
        "/ft/wrench/force/x;/ft/wrench/force/y;/ft/wrench/force/z",
    ],
)
def test_a_load_is_a_word_of_its_channel(names: str, tmp_path: Path) -> None:
    e = made(
        tmp_path, f"x [mm];y [mm];z [mm];dz [µm];{names}\n0;0;0;-41;1;2;-100\n50;0;0;-83;3;4;-200\n"
    ).experiment
    np.testing.assert_allclose(e.wrench[:, :3], [[1, 2, -100], [3, 4, -200]])


@pytest.mark.parametrize("names", ["Fx set;Fx actual", "Fx nominal;Fx measured", "CH1 Fx;CH2 Fx"])
def test_one_of_two_loads_along_an_axis_is_asked_for(names: str, tmp_path: Path) -> None:
    one, other = (f"{name} [N]" for name in names.split(";"))
    text = f"x [mm];y [mm];z [mm];fz [N];dz [µm];{one};{other}\n0;0;0;-100;-41;5;6\n50;0;0;-200;-83;7;8\n"
    with pytest.raises(StiffmapError, match=r"is fx\? Say --map fx='HEADER'"):
        made(tmp_path, text)
    e = made(tmp_path, text, columns={"fx": other}).experiment
    np.testing.assert_allclose(e.wrench[:, 0], [6, 8])


@pytest.mark.parametrize(
    "cell", ["OL", "Overrange", "ERROR", "1.#QNAN", "no signal", "9.9E37", "-9.90000E+37", "9.91E37"]
)
def test_what_an_instrument_says_in_place_of_a_reading_is_none(cell: str, tmp_path: Path) -> None:
    truth(made(tmp_path, f"{HEAD}{ROWS}0;0;50;-100;{cell}\n").experiment)


@pytest.mark.parametrize("row", [";;;-200;-83", ";0;0;-200;-83", "50;0;0;;-83"])
def test_a_number_that_is_written_once_is_asked_for(row: str, tmp_path: Path) -> None:
    with pytest.raises(
        StiffmapError, match=r"line 3: .* found an empty cell; what holds for several rows stands in each"
    ):
        made(tmp_path, f"{HEAD}{ROWS.splitlines()[0]}\n{row}\n")


@pytest.mark.parametrize(
    ("again", "said"),
    [
        ("41;83", "scatter by 0.0926 mm, 1.4 times"),  # the other sign
        ("-82;-166", "scatter by 0.0463 mm, 0.45 times"),  # twice the load
        ("0;0", "scatter by 0.0463 mm, 1 times"),  # without the load
        ("-42;-82", ""),
    ],
)
def test_repeats_that_contradict_are_no_noise(again: str, said: str, tmp_path: Path) -> None:
    one, other = again.split(";")
    found = made(tmp_path, f"{HEAD}{ROWS}0;0;0;-100;{one}\n50;0;0;-200;{other}\n")
    lines = [w for w in found.warnings if "no noise of dz is declared" in w]
    assert [said in w for w in lines] == ([True] if said else []), found.warnings


@pytest.mark.parametrize(
    ("above", "head", "runs"),
    [
        ("", "Position [mm]", "Run {} {} [µm]"),
        ("Operator;Miller\n\n", "Pos. X [mm]", "{}{} [µm]"),
        ("Axis X of 3 May\n", "Target [mm]", "Run {} {} in µm"),
        ("i;1;2;3\n", "x [mm]", "Run {} {} [µm]"),
    ],
)
def test_positions_may_stand_side_by_side_and_runs_below_them(
    above: str, head: str, runs: str, tmp_path: Path
) -> None:
    names = [runs.format(k, side) for k in (1, 2) for side in "+-"]
    rows = "\n".join(f"{n};{k};{k + 0.5};{k - 2}" for k, n in enumerate(names))
    same = {"fz": 0.0, "y": 0.0, "z": 0.0}
    chosen = {"x": head, "dx": "|".join(names)}
    e = made(
        tmp_path, f"{above}{head};-50;0;50\n{rows}\n", columns=chosen, constants=same, quantity="position"
    ).experiment
    np.testing.assert_allclose(e.position[:, 0], np.repeat([-0.05, 0, 0.05], 4))
    np.testing.assert_allclose(
        e.reading[:, 0], 1e-6 * np.add.outer([0, 0.5, -2], [0, 1, 2, 3]).ravel(), atol=1e-15
    )
    assert e.approach is not None and list(e.approach[:4, 0]) == [1, -1, 1, -1]


@pytest.mark.parametrize("zero", ["0", "0.0", "-0", "0 N"])
def test_zero_needs_no_unit_in_its_cell(zero: str, tmp_path: Path) -> None:
    text = f"x;y;z;fx;fz;dz\n0 mm;0;0;{zero};-100 N;-41 µm\n50 mm;0;0;7 N;-200 N;-83 µm\n"
    e = made(tmp_path, text, units={"y": "mm", "z": "mm"}).experiment
    truth(e)
    np.testing.assert_allclose(e.wrench[:, 0], [0, 7])


def test_a_first_table_is_not_passed_over(tmp_path: Path) -> None:
    with pytest.raises(
        StiffmapError, match=r"line 1: column 'x \[mm\]' occurs twice; name the columns: --header"
    ):
        made(tmp_path, f"x [mm];x [mm];dz\n1;2;3\n{HEAD}{ROWS}")


def test_bodies_stand_over_groups_of_their_columns(tmp_path: Path) -> None:
    text = (
        ";Type;Body;Body;Body;Body;Body;Body\n;Name;Base;Base;Base;Tool;Tool;Tool\n;ID;1;1;1;2;2;2\n"
        ";;Position;Position;Position;Position;Position;Position\nFrame;Time;X;Y;Z;X;Y;Z\n1;0,1;0;0;0;1,5;2;3\n2;0,2;0;0;0;1,5;2;3\n"
    )
    chosen = {a: f"Tool Position {a.upper()}" for a in "xyz"}
    e = made(
        tmp_path, text, columns={**chosen, "dz": "Base Position Z"}, constants=LOAD, units={"length": "mm"}
    )
    np.testing.assert_allclose(e.experiment.position, [[1.5e-3, 2e-3, 3e-3]] * 2)


@pytest.mark.parametrize(
    "cell", ["[[1,0],[1,0,0,0],[0,0],[9E9,9E9,9E9]]", "{X 1.5,Y 2.5,Z 3.5,A 0,B 0,C 0}", "[1,2,3,4,5,6,7,8]"]
)
def test_a_position_in_one_cell_is_not_taken_apart(cell: str, tmp_path: Path) -> None:
    rows = "".join(f"{cell};{row}\n" for row in ROWS.splitlines())
    truth(made(tmp_path, f"target;{HEAD}{rows}").experiment)


@pytest.mark.parametrize("cell", ["0.01", "0.1", "0.001"])
def test_numbers_in_the_next_column_are_no_unit(cell: str, tmp_path: Path) -> None:
    """`0.01`, in a header hundredths of a millimetre, was the unit of the column before."""
    text = f"x [mm];y [mm];z [mm];fz [N];dz;sigma\n0;0;0;-100;-41;{cell}\n50;0;0;-200;-83;{cell}\n"
    truth(made(tmp_path, text, units={"length": "um"}).experiment)


@pytest.mark.parametrize("time", ["t [s]", "T (ms)", "t in min", "t [h]"])
def test_a_time_is_no_temperature(time: str, tmp_path: Path) -> None:
    rows = "".join(f"{k};{row}\n" for k, row in enumerate(ROWS.splitlines()))
    found = made(tmp_path, f"{time};{HEAD}{rows}").experiment
    truth(found)
    assert found.temperature is None


@pytest.mark.parametrize("sign", ["-", "\u2212", "\u2013"])
def test_any_sign_of_a_minus(sign: str, tmp_path: Path) -> None:
    truth(made(tmp_path, HEAD + ROWS.replace("-", sign)).experiment)


@pytest.mark.parametrize(
    "text", ["P1={X 1.5,Y 2.5,Z 3.5}\nP2={X 2.5,Y 2.5,Z 3.5}\n", "P[1]{\n X = 1.0 mm, Y = 2.0 mm,\n};\n", "Name;Ax;Dev;Test\nA;X;0.1;Pass\nA;Y;0.2;Pass\n"]
)  # fmt: skip
def test_what_a_row_of_numbers_is_stands_in_the_error(text: str, tmp_path: Path) -> None:
    with pytest.raises(StiffmapError, match="a row of numbers has two or more, each alone in its cell"):
        made(tmp_path, text)


@pytest.mark.parametrize("word", ["mean", "Mittelwert", "average:"])
def test_a_row_of_means_may_say_so_behind_its_numbers(word: str, tmp_path: Path) -> None:
    head, rows = HEAD.replace("\n", ";Remark\n"), ROWS.replace("\n", ";\n")
    found = made(tmp_path, f"{head}{rows}25;0;0;-150;-62;{word}\n")
    truth(found.experiment)
    assert found.remarks == (f"left out: row 4, '{word}', is no reading",)


@pytest.mark.parametrize("words", [("mean", "mean"), ("mean of 3", "max load"), ("ok", "min")])
def test_remarks_that_are_readings_stay(words: tuple[str, str], tmp_path: Path) -> None:
    rows = "".join(f"{r};{w}\n" for r, w in zip(ROWS.split(), words, strict=True))
    truth(made(tmp_path, HEAD.replace("\n", ";Remark\n") + rows).experiment)


POINTS = (
    "P1;X;100;100.012;1\n;Y;50;50.003;1\n;Z;-20;-20.009;1\nP2;z;10;10.02;1\n;x;-30;-30.01;1\n;y;40;40.03;1\n"
)


@pytest.mark.parametrize(
    "head", ["Feature;Axis;Nominal [mm];Actual [mm]", "Punkt;Achse;Sollwert [mm];Istwert [mm]", "Name;Coordinate;Nom [mm];Meas [mm]"]
)  # fmt: skip
def test_rows_of_one_coordinate_each_are_points(head: str, tmp_path: Path) -> None:
    e = made(tmp_path, f"{head};Tol\n{POINTS}", instrument="tracker").experiment
    np.testing.assert_allclose(1e3 * e.position, [[100, 50, -20], [-30, 40, 10]])
    np.testing.assert_allclose(
        1e3 * e.reading[:, :3], [[0.012, 0.003, -0.009], [-0.01, 0.03, 0.02]], atol=1e-9
    )


@pytest.mark.parametrize(
    ("rows", "more"),
    [(POINTS, {"columns": {"x": "3", "y": "3", "z": "3"}}), (POINTS.replace(";Z;-20;-20.009;1\n", ""), {}), (POINTS.replace(";y", ";x"), {})],
)  # fmt: skip
def test_rows_of_one_coordinate_that_are_no_points_are_refused(
    rows: str, more: dict[str, Any], tmp_path: Path
) -> None:
    with pytest.raises(StiffmapError, match=r"line 2|line 5") as found:
        made(tmp_path, f"Name;Axis;Nominal [mm];Actual [mm];Tol\n{rows}", instrument="tracker", **more)
    assert "column 'Axis': each row is one coordinate of a point; expected its rows x, y, z together" in str(
        found.value
    )


def test_axes_of_loads_are_no_coordinates_of_points(tmp_path: Path) -> None:
    text = "Load direction;Load [N];dx [um];dy [um];dz [um]\nX;100;50;1;2\nY;100;1;52;3\nZ;100;2;3;70\n"
    e = made(tmp_path, text, constants={"x": 0.0, "y": 0.0, "z": 0.0}).experiment
    np.testing.assert_allclose(e.wrench[:, :3], 100 * np.eye(3))


@pytest.mark.parametrize("name", ["q{}", "joint_{}", "A{}"])
def test_one_joint_more_from_0_is_asked(name: str, tmp_path: Path) -> None:
    names = [name.format(k) for k in range(7)]
    text = ";".join([*names, "dz [mm]"]) + "\n" + ";".join(["0.5", *COMMANDS, "0.1"]) + "\n"
    units = {"joints": "rad"}
    with pytest.raises(StiffmapError, match="expected 6 joints, found those from 0 to 6: say --map"):
        made(tmp_path, text, "ur10", units=units, constants=LOAD)
    drives = sm.load_machine("ur10").actuators
    columns = dict(zip(drives, names[1:], strict=True))
    e = made(tmp_path, text, "ur10", units=units, constants=LOAD, columns=columns).experiment
    assert e.command is not None
    np.testing.assert_allclose(e.command, [[float(c) for c in COMMANDS]])


GRID = np.array([[x, y, z] for x in (-100, 0, 100) for y in (-100, 0, 100) for z in (-50, 50)], float)
ERRORS = 0.05 * np.sin(np.arange(3 * len(GRID)).reshape(-1, 3) ** 2)
"""mm."""


def points(errors: np.ndarray, turn: float, shift: tuple[float, float, float], head: str, **more: Any) -> str:
    """Commanded points in mm, and where an instrument saw them that is turned about z (deg) and shifted."""
    seen = (GRID + errors) @ Rotation.from_euler("z", turn, degrees=True).as_matrix().T + shift
    seen[more.get("lost", [])] = 0.0
    rows = (";".join(f"{v:.5f}" for v in (*p, *q)) for p, q in zip(GRID, seen, strict=True))
    return head + "\n" + "\n".join(rows) + "\n"


NOISE = {"dx": 0.05, "dy": 0.05, "dz": 0.05}
SIDE = "X nominal;Y nominal;Z nominal;X actual;Y actual;Z actual"
PLACES = "x [mm];y [mm];z [mm];px [mm];py [mm];pz [mm]"


@pytest.mark.parametrize("turn", [0.0, 30.0, 180.0])
@pytest.mark.parametrize(("head", "instrument"), [(SIDE, "tracker"), (PLACES, None)])
def test_points_in_the_frame_of_the_instrument(
    head: str, instrument: str | None, turn: float, tmp_path: Path
) -> None:
    text = points(ERRORS, turn, (2500, 300, -120), head, lost=[4] if instrument else [])
    found = made(tmp_path, text, "tripteron", instrument=instrument, noise=NOISE)
    e = found.experiment
    assert (e.quantity, e.frame, e.tool) == ("position", "unknown", "unknown")
    assert any("in the instrument's own frame" in r for r in found.remarks)
    lost = "left out: line 6: 'X actual', 'Y actual', 'Z actual' are 0, as of a target that was not seen"
    assert (lost in found.remarks) == (instrument is not None)
    assert len(e) == len(GRID) - (instrument is not None)
    kept = np.delete(np.arange(len(GRID)), [4] if instrument else [])
    left = sm.residual("tripteron", e).values[:, :3]
    pattern = np.column_stack(
        [np.ones(len(kept)), GRID[kept]]
    )  # a frame takes up a shift and turns of the errors
    own = ERRORS[kept] - pattern @ np.linalg.lstsq(pattern, ERRORS[kept], rcond=None)[0]
    assert np.nanmax(np.abs(left)) < 1.5e-3 * np.abs(ERRORS).max()
    assert np.corrcoef(left.ravel(), own.ravel())[0, 1] > 0.8


@pytest.mark.parametrize("head", [SIDE, PLACES])
@pytest.mark.parametrize("shift", [0.0, 3.0])
def test_points_near_the_commands_are_in_their_frame(head: str, shift: float, tmp_path: Path) -> None:
    text = points(ERRORS, 0.0, (shift, 0, 0), head)
    instrument = "tracker" if head == SIDE else None
    e = made(tmp_path, text, "tripteron", instrument=instrument, noise=NOISE).experiment
    assert (e.quantity, e.frame) == ("position", "known")
    left = sm.residual("tripteron", e).values[:, :3]
    np.testing.assert_allclose(left, 1e-3 * (ERRORS + [shift, 0, 0]), atol=2e-8)


def test_differences_from_places_far_away_are_no_places(tmp_path: Path) -> None:
    far = GRID + [900.0, 0, 0]
    rows = "\n".join(";".join(f"{v:g}" for v in (*p, *e)) for p, e in zip(far, ERRORS, strict=True))
    text = f"x [mm];y [mm];z [mm];dx [mm];dy [mm];dz [mm]\n{rows}\n"
    assert not made(tmp_path, text, "ur10", quantity="position", noise=NOISE).warnings
    seen = points(ERRORS, 90.0, (900, 0, 0), "x [mm];y [mm];z [mm];dx [mm];dy [mm];dz [mm]")
    found = made(tmp_path, seen, "ur10", quantity="position", noise=NOISE, overwrite=True)
    assert "change as the commanded places do" in found.warnings[0]


@pytest.mark.parametrize(
    ("turn", "unit", "mm"), [(0.0, "mm", 1.0), (40.0, "m", 1e3), (-120.0, "mil", 0.0254)]
)
def test_loaded_and_unloaded_places_in_the_frame_of_the_instrument(
    turn: float, unit: str, mm: float, tmp_path: Path
) -> None:
    axes = Rotation.from_euler("zx", [turn, 0.2 * turn], degrees=True).as_matrix()
    deflections = 0.1 * np.cos(np.arange(3 * len(GRID)).reshape(-1, 3))
    places = [((p @ axes.T) + (2500, 300, -120)) / mm for p in (GRID + ERRORS, GRID + ERRORS + deflections)]
    rows = (";".join(f"{v:.9f}" for v in (*p, 100, *u, *w)) for p, u, w in zip(GRID, *places, strict=True))
    names = (f"{a} {s} [{unit}]" for s in ("unloaded", "loaded") for a in "XYZ")
    text = "\n".join([";".join(["x [mm];y [mm];z [mm];Fx [N]", *names]), *rows, ""])
    found = made(tmp_path, text, "tripteron", noise=dict.fromkeys(NOISE, 0.05 / mm))
    np.testing.assert_allclose(found.experiment.reading[:, :3], 1e-3 * deflections, atol=2e-7)
    np.testing.assert_allclose(found.experiment.sigma[:, :3], 5e-5)
    assert any("turned from its axes into those of the base" in r for r in found.remarks)


def test_commands_on_a_line_show_no_axes(tmp_path: Path) -> None:
    places = GRID * [1.0, 0.0, 0.0] + (2500, 300, -120)
    rows = (
        ";".join(f"{v:g}" for v in (p[0], 0, 0, 100, *q, *(q + 0.1)))
        for p, q in zip(GRID, places, strict=True)
    )
    names = (f"{a} {s} [mm]" for s in ("unloaded", "loaded") for a in "XYZ")
    text = "\n".join([";".join(["x [mm];y [mm];z [mm];Fx [N]", *names]), *rows, ""])
    with pytest.raises(StiffmapError, match=r"record.csv: the commands lie on a line.*dx, dy, dz"):
        made(tmp_path, text, "tripteron", noise=NOISE)


def test_unloaded_gauges_that_are_no_places_are_taken_as_they_are(tmp_path: Path) -> None:
    rows = (
        ";".join(f"{v:.6f}" for v in (*p, 100, *e, *(e + 0.1))) for p, e in zip(GRID, ERRORS, strict=True)
    )
    head = ";".join(
        ["x [mm];y [mm];z [mm];Fx [N]", *(f"{a} {s} [mm]" for s in ("unloaded", "loaded") for a in "XYZ")]
    )
    found = made(tmp_path, head + "\n" + "\n".join(rows) + "\n", "tripteron", noise=NOISE)
    np.testing.assert_allclose(found.experiment.reading[:, :3], 1e-4, atol=1e-9)
    assert not any("turned" in r for r in found.remarks)


@pytest.mark.parametrize("lever", [(0.0, 0.0, 0.0), (0.03, -0.02, 0.08)])
def test_the_same_of_an_arm_that_is_commanded_by_its_joints(
    lever: tuple[float, float, float], tmp_path: Path
) -> None:
    machine = sm.load_machine("ur10")
    q = np.deg2rad(
        [
            [20 * i, -80 + 15 * j, 80 - 20 * i, -90 + 10 * j, -90 + 30 * i, 10 * i]
            for i in range(4)
            for j in range(4)
        ]
    )
    pose = sm.forward_kinematics(machine, q)
    target = 1e3 * (pose.position + pose.rotation @ lever)
    deflections = np.cos(np.arange(target.size).reshape(-1, 3))
    axes = Rotation.from_euler("zyx", [70, -8, 3], degrees=True).as_matrix()
    places = [p @ axes.T + (2500, 300, -120) for p in (target, target + deflections)]
    rows = (
        ";".join(f"{v:.7f}" for v in (*c, -50, *u, *w))
        for c, u, w in zip(np.degrees(q), *places, strict=True)
    )
    head = ";".join(
        [
            *(f"q{k} [deg]" for k in range(1, 7)),
            "Fz [N]",
            *(f"{a} {s} [mm]" for s in ("unloaded", "loaded") for a in "XYZ"),
        ]
    )
    found = made(tmp_path, head + "\n" + "\n".join(rows) + "\n", "ur10", noise=NOISE)
    np.testing.assert_allclose(found.experiment.reading[:, :3], 1e-3 * deflections, atol=1e-8)
    assert any("the target sits at (30, -20, 80) mm" in r for r in found.remarks) == any(lever)


@pytest.mark.parametrize(("unit", "warned"), [("um", False), ("mm", True)])
def test_differences_in_a_unit_that_no_machine_is_off_by(unit: str, warned: bool, tmp_path: Path) -> None:
    rows = "\n".join(";".join(f"{v:g}" for v in (*p, *(1e3 * e))) for p, e in zip(GRID, ERRORS, strict=True))
    text = f"x [mm];y [mm];z [mm];dx;dy;dz\n{rows}\n"
    units = dict.fromkeys(("dx", "dy", "dz"), unit)
    found = made(tmp_path, text, "tripteron", quantity="position", noise=NOISE, units=units)
    assert any("are they differences, and in this unit?" in w for w in found.warnings) == warned


@pytest.mark.parametrize(
    ("unit", "size"),
    [
        ("N-m", 1.0),
        ("N.m", 1.0),
        ("N-mm", 1e-3),
        ("N cm", 1e-2),
        ("lbf-in", 0.112984829),
        ("in-lb", 0.112984829),
    ],
)
@pytest.mark.parametrize("name", ["T{}", "M{}"])
def test_moments_of_load_cells_are_loads(name: str, unit: str, size: float, tmp_path: Path) -> None:
    """Written with a hyphen or a point they went to the notes without a word."""
    heads = ";".join(f"{name.format(a)} ({unit})" for a in "xyz")
    text = f"x (mm);y (mm);z (mm);Fx (N);Fy (N);Fz (N);{heads};dx (mm)\n0;0;0;1;2;3;4;5;6;0.1\n9;0;0;1;2;3;4;5;6;0.1\n"
    e = made(tmp_path, text).experiment
    np.testing.assert_allclose(e.wrench[0], [1, 2, 3, 4 * size, 5 * size, 6 * size])


@pytest.mark.parametrize("unit", ["", " (counts)"])
def test_moments_of_an_unknown_unit_are_asked_for(unit: str, tmp_path: Path) -> None:
    text = (
        f"x (mm);y (mm);z (mm);Fx (N);Fy (N);Fz (N);Tz{unit};dx (mm)\n0;0;0;1;2;3;4;0.1\n9;0;0;1;2;3;4;0.1\n"
    )
    with pytest.raises(StiffmapError, match=r"column 'Tz' \(mz\).*unit"):
        made(tmp_path, text)


TWO = "{0}0{1}0{1}0{1}-100{1}-41\n{2}50{1}0{1}0{1}-200{1}-83\n"


@pytest.mark.parametrize(
    "above",
    [
        "Channels;5\nY_Unit_Label;mm;mm;mm;N;µm\nX_Dimension;Time;Time;Time;Time;Time\nX0;0,0;0,0;0,0;0,0;0,0\n***End***\nX_Value;x;y;z;Fz;dz\n",
        "VUnit;mm;mm;mm;N;µm\nTraceName;x;y;z;Fz;dz\nBlockSize;2;2;2;2;2\n;;;;;\n",
        "t;x;y;z;Fz;dz\nEinheit = s;Einheit = mm;Einheit = mm;Einheit = mm;Einheit = N;Einheit = µm\n",
        "t;x;y;z;Fz;dz\n100 Hz;100 Hz;100 Hz;100 Hz;100 Hz;100 Hz\ns;mm;mm;mm;N;µm\nMX840;MX840;MX840;MX840;MX840;MX840\n",
        "t [s];x [mm];y [mm];z [mm];Fz [N];dz [µm]\nCH 1;CH 2;CH 3;CH 4;CH 5;CH 6\nEinheit = s;Einheit = mm;Einheit = mm;Einheit = mm;Einheit = N;Einheit = µm\n",
    ],
    ids=["units above", "units, rates", "units below", "rates, units, devices", "channels"],
)  # fmt: skip
def test_names_and_units_in_a_block_of_lines(above: str, tmp_path: Path) -> None:
    """As LabVIEW, oscilloscopes and catman write them, with lines of devices and rates between."""
    truth(made(tmp_path, above + TWO.format("0;", ";", "0,1;")).experiment)


@pytest.mark.parametrize(
    "path", ["Untitled/{}", '"DB1".{}', "/'Untitled'/'{}'", r"Group\{}", "GVL.stAxis.{}"]
)
def test_names_behind_one_path(path: str, tmp_path: Path) -> None:
    """As of groups of channels and blocks of a controller."""
    names = ";".join(
        f'"{path.format(n)}"' if '"' not in path else path.format(n) for n in ("x", "y", "z", "Fz", "dz")
    )
    found = made(
        tmp_path,
        f"Time stamp;{names}\n{TWO.format('0;', ';', '1;')}",
        units={"length": "mm", "dz": "um", "force": "N"},
    )
    truth(found.experiment)  # fmt: skip


def test_a_vector_behind_a_path_is_no_position(tmp_path: Path) -> None:
    text = "/imu/acceleration/x;/imu/acceleration/y;/imu/acceleration/z;Fz [N];dz [µm]\n" + TWO.format(
        "", ";", ""
    )
    with pytest.raises(StiffmapError, match="which column is the position x"):
        made(tmp_path, text)


@pytest.mark.parametrize("labels", ["Kanal;1;2;3;4;5\n", "SN;30123;30124;30125;30126;30127\n"])
def test_numbers_of_channels_below_the_names_are_no_readings(labels: str, tmp_path: Path) -> None:
    rows = "".join(f"{0.02 * i:.2f};{row}\n" for i, row in enumerate(ROWS.splitlines()))
    found = made(tmp_path, f"Zeit [s];{HEAD}{labels}{rows}")
    truth(found.experiment)
    assert f"row 2, '{labels.partition(';')[0]}', is no reading" in str(found.remarks)


def test_a_row_with_a_name_stays_where_others_have_numbers(tmp_path: Path) -> None:
    first, second = ROWS.splitlines()
    truth(made(tmp_path, f"id;{HEAD}home;{first}\n2;{second}\n").experiment)


def test_a_remark_ahead_of_a_row_keeps_it(tmp_path: Path) -> None:
    first, second = ROWS.splitlines()
    truth(made(tmp_path, f"Bemerkung;{HEAD};{first}\nok;{second}\n").experiment)


@pytest.mark.parametrize("units", ["mm;mm;mm;N;counts", "mm;mm;mm;N;[div]"])
def test_an_unknown_unit_in_a_line_of_units_is_named(units: str, tmp_path: Path) -> None:
    with pytest.raises(StiffmapError, match=r"column 'dz' \(dz\): the unit '(counts|div)' is not known"):
        made(tmp_path, f"x;y;z;fz;dz\n{units}\n{ROWS}")


@pytest.mark.parametrize("above", ["Version;2.1", "Sample rate;1000.0;Hz", "Scale factor [-];1.0;;;"])
def test_a_number_above_the_table_does_not_tell_its_decimal_sign(above: str, tmp_path: Path) -> None:
    truth(made(tmp_path, f"{above}\n{HEAD}0,0;0,0;0;-100;-41,0\n50,0;0;0;-200;-83,0\n").experiment)


@pytest.mark.parametrize(
    "above", ["TIME_STAMP\t2024-05-03\t1234.5\nMARKER_NAMES\ttool\n", "Rate\t100\tHz\nTake\tA\nTools\tB\n"]
)
def test_a_line_of_numbers_above_remarks_is_no_header(above: str, tmp_path: Path) -> None:
    with pytest.raises(StiffmapError, match=r"no header line.*--header"):
        made(tmp_path, above + "1\t0\t0\t0\t-100\n2\t50\t0\t0\t-200\n")


@pytest.mark.parametrize("over", [",,,arm:tool,,", ",,,Rotation,,", "Frame,Time,,Position,,"])
def test_a_group_does_not_reach_over_joints(over: str, tmp_path: Path) -> None:
    """Of motion capture, whose columns others follow; the quaternion is no reading."""
    joints = ",".join(f"J{k + 1} [rad]" for k in range(6))
    text = (
        f"{over},,,,,,,,,\n,,,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Error,,,,,,\n"
        f"Frame,Time,Ball,X,Y,Z,W,X,Y,Z,,{joints}\n"
        + "".join(f"{i},{i},1,0,0,0.6,0.8,{1400 + i},200,300,0,{','.join(COMMANDS)}\n" for i in range(3))
    )
    columns = {f"p{a}": f"Position {a.upper()}" for a in "xyz"}
    made(tmp_path, text, machine="ur10", columns=columns, units={"length": "mm"})
    data = (tmp_path / "e" / "data.csv").read_text().splitlines()
    assert data[0].startswith("px,py,pz,q1,q2,q3,q4,q5,q6")
    assert data[1].split(",")[:3] == ["1400.0", "200.0", "300.0"] and data[1].split(",")[3:9] == list(
        COMMANDS
    )
