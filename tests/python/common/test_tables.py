"""One reader for all commands: a table is the same in every spelling, for a path, a pose table and a list of points."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import stiffmap as sm
from stiffmap.common.errors import FileError
from stiffmap.common.tables.lines import Spelling, is_finite
from stiffmap.common.tables.pose_table import read_pose_table
from stiffmap.common.tables.sheet import read_sheet
from stiffmap.common.tables.table_file import TableFile
from stiffmap.common.texts import text_of
from stiffmap.experiment.files.table import read_table
from stiffmap.machining.process import load_process
from stiffmap.machining.toolpath.load import load_path
from stiffmap.model.link.readers import read_csv_field
from stiffmap.model.urdf import import_urdf
from stiffmap.workspace.vibration.files import read_responses

SPELLINGS = {
    "commas": ("x [mm],y [mm],z [mm]\n50.5,0,700\n0,-20.25,700\n", "utf-8"),
    "underscores": ("x_mm,y_mm,z_mm\n50.5,0,700\n0,-20.25,700\n", "utf-8"),
    "round brackets and tabs": ("X (mm)\tY (mm)\tZ (mm)\n50.5\t0\t700\n0\t-20.25\t700\n", "utf-8"),
    "semicolons, decimal commas": ("x [mm];y [mm];z [mm]\n50,5;0;700\n0;-20,25;700\n", "utf-8-sig"),
    "decimal commas, thousands": ("x [um];y [mm];z [mm]\n50.500;0,0;700\n0;-20,25;700\n", "utf-8"),
    "decimal commas, powers of ten": ("x [mm];y [mm];z [mm]\n5,05E+01;0;7,0E+02\n0;-2,025D+01;7E2\n", "utf-8"),
    "blanks": ("x [mm] y [mm]  z [mm]\n50.5 0   700\n0 -20.25 700\n", "utf-8"),
    "UTF-16": ("x [mm],y [mm],z [mm]\n50.5,0,700\n0,-20.25,700\n", "utf-16"),
    "UTF-16 without a mark": ("x [mm],y [mm],z [mm]\n50.5,0,700\n0,-20.25,700\n", "utf-16-le"),
    "Latin-1 with a remark": ("# gemessen in Köln\nx [µm],y [cm],z [m]\n50500,0,0.7\n0,-2.025,0.7\n", "latin-1"),
    "GB 2312 with full-width brackets": ("序号,X坐标（毫米）,Y坐标（毫米）,Z坐标（米）\n1,50.5,0,0.7\n2,0,-20.25,0.7\n", "gb2312"),
    "numpy.savetxt": ("# x[mm] y[mm] z[mm]\n5.05e+01 0.0e+00 7.0e+02\n0.0e+00 -2.025e+01 7.0e+02\n", "utf-8"),
    "units in a line of their own": ("X;Y;Z\nmm;mm;mm\n50.5;0;700\n0;-20.25;700\n", "utf-8"),
    "units in the cells": ("x;y;z\n50,5 mm;0 mm;700 mm\n0 mm;-20,25mm;700 mm\n", "utf-8"),
    "units behind a word": ("x in mm;y, mm;z / mm\n50.5;0;700\n0;-20.25;700\n", "utf-8"),
    "lines above, and names of rows": ("Points of 12 March\n\nNr;Pos X [mm];Pos Y [mm];TCP Z [mm]\nP1;50,5;0;700\nP2;0;-20,25;700\n", "utf-8"),
    "a unit over all names": ("Places [mm];;\nx;y;z\n50.5;0;700\n0;-20.25;700\n", "utf-8"),
    "inches and thou": (f"x [thou],y [in],z [inch]\n{50.5 / 0.0254},0,{700 / 25.4}\n0,{-20.25 / 25.4},{700 / 25.4}\n", "utf-8"),
}  # fmt: skip
POINTS = [[0.0505, 0.0, 0.7], [0.0, -0.02025, 0.7]]


@pytest.mark.parametrize("name", SPELLINGS)
def test_a_table_is_the_same_in_every_spelling_and_command(name: str, tmp_path: Path) -> None:
    text, encoding = SPELLINGS[name]
    file = tmp_path / "points.csv"
    file.write_text(text, encoding=encoding)
    np.testing.assert_allclose(read_pose_table(file).position, POINTS, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(load_path(file).end[-1], POINTS[-1], rtol=1e-12, atol=1e-15)


LABVIEW = "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\n***End_of_Header***\t\n\t\n"


def labview(kind: str, units: str, rows: str) -> str:
    """A file as LabVIEW writes it: two headers, numbers in them, a cell for comments that no row has."""
    head = f"Channels\t2\t\nSamples\t3\t3\nX_Dimension\t{kind}\t{kind}\nY_Unit_Label\t{units}\nX0\t0.0\t0.0\nDelta_X\t0.5\t0.5\n"
    return f"{LABVIEW}{head}***End_of_Header***\t\t\n{rows}"


def test_files_of_labview(tmp_path: Path) -> None:
    times = labview("Time", "N\tmm", "X_Value\tFx\tdx\tComment\n0.0\t1.5\t2\n0.5\t1.25\t3\n1.0\t1\t4\n")
    for text, comma in ((times, False), (times.replace(".", ","), True)):
        (tmp_path / "t.lvm").write_text(text)
        table = read_sheet(tmp_path / "t.lvm")
        assert table.header == ("Time [s]", "Fx [N]", "dx [mm]") and table.decimal_comma is comma
        assert [*table.lines] == [14, 15, 16] and not table.left_out
        np.testing.assert_array_equal(table.numbers(1), [1.5, 1.25, 1])
    rows = "".join(f"{f}\t{1 / (1 - (f / 12) ** 2)}\t{170 - f}\n" for f in range(5, 9))
    (tmp_path / "f.lvm").write_text(
        labview("Frequency", "m/s^2/N\tdeg", f"X_Value\tMagnitude\tPhase\n{rows}")
    )
    (found,) = read_responses(tmp_path / "f.lvm")
    w = 2 * np.pi * 6
    assert found.receptance[1] == pytest.approx(-np.exp(1j * np.radians(164)) / (1 - 0.25) / w**2, rel=1e-12)


@pytest.mark.parametrize(
    ("content", "found"),
    [
        (b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (4, 4), }\n" + bytes(128), "a binary file"),
        (b'[{"x": 1.0, "y": 2.0, "z": 3.0}, {"x": 1.5, "y": 2.0, "z": 3.0}]', "JSON"),
        (b'{"x": [1.0, 1.5], "y": [2.0, 2.0]}', "JSON"),
    ],
)  # fmt: skip
def test_what_is_no_text_is_said(content: bytes, found: str, tmp_path: Path) -> None:
    (tmp_path / "t.dat").write_bytes(content)
    with pytest.raises(
        FileError, match=rf"expected rows of text, or a workbook \(.*\), found {found}: save the table as CSV"
    ):
        read_sheet(tmp_path / "t.dat")


def test_units_of_several_behind_a_word(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(
        "f in Hz;Nachgiebigkeit in µm/N;Phase in °\n5;2,5;-10\n6;3,5;-20\n7;3;-90\n"
    )
    (found,) = read_responses(tmp_path / "r.csv")
    np.testing.assert_allclose(found.receptance[0], 2.5e-6 * np.exp(-1j * np.radians(10)), rtol=1e-12)


@pytest.mark.parametrize(
    ("text", "points"),
    [
        ("Plane Z = 700 mm\nX [mm],Y [mm]\n50.5,0\n0,-20.25\n", POINTS),
        ("Z,700,mm\nX [mm],Y [mm]\n50.5,0\n0,-20.25\n", POINTS),
        ("Z: 0.7 m\nX [mm];Y [mm]\n50,5;0\nZ: 0,7 m\nX [mm];Y [mm]\n0;-20,25\n", POINTS),
    ],
)
def test_a_title_says_a_coordinate_of_the_rows_below(
    text: str, points: list[list[float]], tmp_path: Path
) -> None:
    (tmp_path / "points.csv").write_text(text)
    with pytest.warns(UserWarning, match=r"'Z \[mm?\]' stands in the title"):
        np.testing.assert_allclose(read_pose_table(tmp_path / "points.csv").position, points, atol=1e-15)


def test_what_logs_have_next_to_poses_is_left_out_with_a_word(tmp_path: Path) -> None:
    rows = "N;Time [s];x [mm];y [mm];z [mm];Velocity [mm/s]\n1;0;50.5;0;700;10\n2;1;0;-20.25;700;12\n"
    (tmp_path / "points.csv").write_text(rows)
    with pytest.warns(UserWarning, match=r"left out: Velocity \[mm/s\]"):
        found = read_pose_table(tmp_path / "points.csv")
    np.testing.assert_allclose(found.position, POINTS, atol=1e-15)
    np.testing.assert_allclose(found.values["t"], [0, 1])
    with pytest.warns(UserWarning, match=r"left out: Time \[s\]"):
        path = load_path(tmp_path / "points.csv")
    np.testing.assert_allclose(path.feed[-1], 12e-3)


def test_a_title_changes_no_column_and_takes_no_other_quantity(tmp_path: Path) -> None:
    text = "Measured at z = 20 °C, x = 3 mm\nx [mm],y [mm],z [mm]\n50.5,0,700\n0,-20.25,700\n"
    (tmp_path / "points.csv").write_text(text)
    np.testing.assert_allclose(read_pose_table(tmp_path / "points.csv").position, POINTS, atol=1e-15)
    (tmp_path / "points.csv").write_text(text.replace(",z [mm]", "").replace(",700", ""))
    with pytest.raises(FileError, match="no column z"):
        read_pose_table(tmp_path / "points.csv")


@pytest.mark.parametrize(
    "reader", [sm.load_machine, load_process, load_path, read_responses, read_csv_field, sm.import_urdf]
)
def test_a_folder_is_no_file(reader: Callable[[Path], object], tmp_path: Path) -> None:
    with pytest.raises(FileError, match=rf"^{re.escape(str(tmp_path))}: .*(found a folder|Is a directory)$"):
        reader(tmp_path)


def test_a_workbook_is_a_table_of_every_command(tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for row in (
        ["Points of March"],
        [],
        ["Nr", "x", "y", "z"],
        ["", "mm", "mm", "mm"],
        [1, 50.5, 0, 700],
        [2, 0, -20.25, 700],
    ):
        book.active.append(row)
    book.save(tmp_path / "points.xlsx")
    file = tmp_path / "points.xlsx"
    np.testing.assert_allclose(read_pose_table(file).position, POINTS, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(load_path(file).end[-1], POINTS[-1], rtol=1e-12, atol=1e-15)
    book.active.delete_rows(1, 6)
    for row in (["frequency_Hz", "real_um/N", "imag_um/N"], [10, 1, 0], [20, 2, -1]):
        book.active.append(row)
    book.save(tmp_path / "response.xlsx")
    np.testing.assert_allclose(read_responses(tmp_path / "response.xlsx")[0].receptance, [1e-6, 2e-6 - 1e-6j])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x [mm];y [mm];z [mm]\n1;2;3\n1;zwei;3\n", r"line 3: column 'y \[mm\]': expected a number; found 'zwei'"),
        ("x [kg],y [mm],z [mm]\n1,2,3\n1,2,4\n", r"line 1: x \[kg\]: expected a unit such as in x.*, found kg"),
        ("# one\n\nx [mm],y [mm],z [mm]\n1,2,3\n\n1,2\n", "line 6: expected 3 values, found 2"),
        ("x [mm],y [mm],z [mm]\n1,2,3\n1,2,3,4\n", "line 3: expected 3 values, found 4"),
        *((f"x_mm y_mm z_mm\n{n} 10 20 30\n{m} 10 20 40\n".replace(" ", sep), "line 2: expected 3 values, found 4; where the first counts or names the rows, write row")
          for n, m in (("1", "2"), ("p1", "p2")) for sep in "\t, "),
        ("x [mm],y [mm],z [mm]\n1,2,3\nsigned: A. Smith,,\n", "expected rows of numbers alone below the header; row 3 is a remark"),
        ("x [mm],y [mm],z [mm],w\n1,2,3,4\n1,2,4,4\n", "line 1: unknown column 'w'"),
        ("1,2,3\n1,2,4\n", r"no header line with rows of numbers below it was found; expected its names of columns, such as x.*, y"),
        ("x [mm],y [mm],X (mm)\n1,2,3\n1,2,4\n", r"line 1: a column is given twice, as 'x \[mm\]' and 'X \(mm\)'"),
    ],
)  # fmt: skip
def test_every_command_names_line_and_column(text: str, words: str, tmp_path: Path) -> None:
    file = tmp_path / "points.csv"
    file.write_text(text, encoding="utf-8")
    for read in (read_pose_table, load_path):
        with pytest.raises(FileError, match=words):
            read(file)


@pytest.mark.parametrize(
    "text",
    [
        "id,x,dx\n1,50.5,1\n2,-1.25,\n",
        "id;x;dx\n1;50,5;1\n2;-1,25;\n",
        "\ufeffid\tx\tdx\n1\t50.5\t1\n2\t-1.25\t\n",
    ],
)
def test_readings_are_the_same_in_every_spelling(text: str, tmp_path: Path) -> None:
    file = tmp_path / "data.csv"
    file.write_text(text, encoding="utf-8")
    table = read_table(file)
    np.testing.assert_array_equal(table.si("x"), [50.5, -1.25])
    np.testing.assert_array_equal(table.si("dx", blank=True), [1.0, np.nan])


def test_a_thousand_in_quotes_is_no_decimal_comma(tmp_path: Path) -> None:
    file = tmp_path / "data.csv"
    file.write_text('id,x,dx\n1,"1,000",1\n', encoding="utf-8")
    with pytest.raises(FileError, match="line 2: column 'x': expected a number; found '1,000'"):
        read_table(file).si("x")


ROWS = "x [mm],fx [N],dx [um]\n0,100,40\n1,200,80\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            ROWS.replace("200,80", "200,7,5"),
            "line 3: expected 3 values, found 4",
        ),
        ("x [mm],fx [N],dx [um]\n1,0,100,40\n2,1,200,80\n", "line 2: expected 3 values"),
        (ROWS.replace(",", " ").replace("200 80", "200"), "line 3: expected 3 values, found 2"),
        (f"Nr {ROWS.replace(',', ' ')}", "line 2: expected 4 values, found 3"),
    ],
)
def test_a_row_whose_cells_may_be_those_of_other_columns(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "t.txt").write_text(text)
    with pytest.raises(FileError, match=words):
        read_sheet(tmp_path / "t.txt")


@pytest.mark.parametrize("head", ["Force x Force y", "dx mean   dy mean", "X cmd\tY cmd"])
def test_names_with_blanks_between_blanks_are_said(head: str, tmp_path: Path) -> None:
    (tmp_path / "t.txt").write_text(f"{head}\n1.5 2.5\n3.5 4.5\n")
    with pytest.raises(FileError, match=r"occurs twice \(names with blanks"):
        read_sheet(tmp_path / "t.txt")


@pytest.mark.parametrize("text", [ROWS, ROWS.replace(",", " "), ROWS.replace(",", ";")])
def test_words_behind_a_row_are_said(text: str, tmp_path: Path) -> None:
    between = next(s for s in " ;," if s in text.splitlines()[1])
    (tmp_path / "t.txt").write_text(text.replace("80", f"80{between}# bumped"))
    sheet = read_sheet(tmp_path / "t.txt")
    assert sheet.numbers(2).tolist() == [40.0, 80.0]
    assert sheet.left_out == ("row 3, '# bumped' behind the last column",)


def test_what_is_no_reading_is_found_anywhere_in_a_long_table(tmp_path: Path) -> None:
    """Rows that are plain are taken some hundreds at a time."""
    rows = [f"P{i},{i}.5,{i % 7},0,{0.001 * i:.3f}" for i in range(2000)]
    odd = {
        3: "Mean,1,2,3,4",
        777: ",12,5,0,9",
        1203: "# a remark, 5",
        1499: "P1499,1,2,0,4,seen twice",
        1600: "",
    }
    odd |= {1777: "P1777,1,2", 1998: ",,,,", 1999: "checked by hand,,,,"}
    for i, text in odd.items():
        rows[i] = text
    file = tmp_path / "long.csv"
    file.write_text("id,x [mm],y [mm],z [mm],dz [mm]\n" + "\n".join(rows) + "\n")
    table = read_sheet(file)
    left_out = {3, 1203, 1600, 1998, 1999}
    assert list(table.lines) == [i + 2 for i in range(2000) if i not in left_out]
    assert table.left_out == (
        "row 5, 'Mean', is no reading",
        "row 1501, 'seen twice' behind the last column",
        "row 1205 is a remark: # a remark 5",
        "row 2001 is a remark: checked by hand",
    )
    dz = table.numbers(4)
    assert np.isnan(dz[list(table.lines).index(1779)])
    np.testing.assert_allclose(dz[:3], [0.0, 0.001, 0.002], atol=0)
    assert next(iter(table.columns[0])) == "P0"
    assert list(table.columns[0])[775:778] == ["P776", "", "P778"]


@pytest.mark.parametrize("text", ["0.123", "-0.041", "0.000"])
def test_a_decimal_fraction_below_one_is_never_thousands(text: str, tmp_path: Path) -> None:
    file = tmp_path / "t.csv"
    file.write_text(f"x [mm];y [mm];z [mm]\n1;2;{text}\n3;4;10.250\n")
    assert not read_sheet(file).decimal_comma
    file.write_text(f'x [mm],y [mm],z [mm]\n"1,500",2,{text}\n"3,25",4,5\n')
    assert not read_sheet(file).decimal_comma


@pytest.mark.parametrize("mark", ["#", "%", "//"])
def test_a_heading_between_rows_is_said_where_it_is_a_comment(mark: str, tmp_path: Path) -> None:
    rows = f"{mark} loading\nx [mm],fx [N],dx [mm]\n0,50,0.1\n1,50,0.1\n{mark}\n{mark}----\n{mark} unloading\n0,50,0.2\n"
    (tmp_path / "t.csv").write_text(rows)
    assert read_sheet(tmp_path / "t.csv").left_out == (f"row 7 is a remark: {mark} unloading",)


@pytest.mark.parametrize(
    "text",
    [
        "| P | x [mm] | y [mm] |\n|---|--------|--------|\n| P 1 of A | 1.5 | 2 |\n| P 2 of A | 2.5 | 3 |\n",
        "P | x [mm] | y [mm]\n--- | ---: | ---\nP 1 + 2 | 1.5 | 2\nP 3 + 4 | 2.5 | 3\n",
        "|P|x [mm]|y [mm]|\n|:-:|:-:|:-:|\n|90 + 1 a|1.5|2|\n|90 - 2 a|2.5|3|\n",
    ],
)
def test_bars_part_cells_that_have_blanks(text: str, tmp_path: Path) -> None:
    (tmp_path / "t.md").write_text(text)
    t = read_sheet(tmp_path / "t.md")
    x, y = (t.numbers(t.header.index(f"{a} [mm]")) for a in "xy")
    np.testing.assert_array_equal([x, y], [[1.5, 2.5], [2.0, 3.0]])


@pytest.mark.parametrize(
    ("units", "size"),
    [
        ("Hz;g/N;g/N", 9.80665),
        ("Hz;m/s^2/N;m/s^2/N", 1.0),
        ("kHz;(m/s²/N);(m/s²/N)", 1.0),
        ("-;m/s2/N;m/s2/N", 0.0),
    ],
)
def test_a_line_of_units_may_have_quotients(units: str, size: float, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(f"Frequency;Real;Imag\n{units}\n10;1;0\n20;2;0\n")
    if not size:  # no unit of the frequency
        with pytest.raises(FileError, match="frequencies in Hz"):
            read_responses(tmp_path / "t.csv")
        return
    found = read_responses(tmp_path / "t.csv")[0]
    omega = 2 * np.pi * found.frequency
    np.testing.assert_allclose(found.receptance, [size, 2 * size] / -(omega**2))


@pytest.mark.parametrize(
    "text",
    [
        "frequency_Hz,FRF [m/N]\n10,0.1+0.2i\n20,-1.5e-3-2E-1i\n",
        "Frequency;H\nHz;m/N\n10;(0.1+0.2j)\n20;(-1.5e-3-2E-1j)\n",
        "frequency [Hz];H1 (m/N);coherence\n10;0.1 + j0.2;0.9\n20;-.0015 - j*2E-1;0.8\n",
    ],
)
def test_responses_of_complex_numbers(text: str, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(text)
    found = read_responses(tmp_path / "t.csv")[0]
    np.testing.assert_allclose(found.receptance, [0.1 + 0.2j, -1.5e-3 - 0.2j])
    (tmp_path / "t.csv").write_text(
        text.replace("20", "20", 1).rpartition("20")[0] + "20,fast\n".replace(",", text[12])
    )
    with pytest.raises(FileError):
        read_responses(tmp_path / "t.csv")


@pytest.mark.parametrize(
    "text",
    [
        "Timestamp;x;y;z;Remark\n;mm;mm;mm;\n3 May 10:00;1,5;0;0;first\n3 May 10:01;2;0;0;\n",
        "x [mm],y [mm],z [mm],Comment\n1.5,0,0,\n2,0,0,again\n",
        "Pose,x [mm],y [mm],z [mm],Serial No\n3,1.5,0,0,4711\n3,2,0,0,4711\n",
    ],
)
def test_remarks_next_to_numbers_are_left_out(text: str, tmp_path: Path) -> None:
    (tmp_path / "p.csv").write_text(text, encoding="utf-8")
    assert read_pose_table(tmp_path / "p.csv").position[:, 0].tolist() == [0.0015, 0.002]


@pytest.mark.parametrize("first", ["target_TCP_pose", "actual_TCP_pose"])
def test_the_pose_of_a_robots_log_is_in_its_units_against_the_base(first: str, tmp_path: Path) -> None:
    """m and radians; the commanded one before the measured one, joints and times are left out with a word."""
    heads = [f"{n}_{k}" for n in ("actual_q", first, "actual_TCP_speed") for k in range(6)]
    rows = np.arange(36.0).reshape(2, 18) / 50
    if first.startswith("target"):
        heads, rows = [f"actual_TCP_pose_{k}" for k in range(6)] + heads, np.hstack([rows[:, :6] + 1, rows])
    cells = "\n".join(" ".join(map(repr, [0.1, *row])) for row in rows.tolist())
    (tmp_path / "p.csv").write_text(f"timestamp {' '.join(heads)}\n{cells}\n")
    with pytest.warns(UserWarning, match="p.csv: left out: timestamp, actual_"):
        found = read_pose_table(tmp_path / "p.csv")
    np.testing.assert_allclose(found.position, rows[:, -12:-9])
    turned = found.rotation(np.diag([1.0, -1.0, -1.0]))
    np.testing.assert_allclose(turned, Rotation.from_rotvec(rows[:, -9:-6]).as_matrix())


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "x,y,z\nmm,mm,furlong\n1,2,3\n4,5,6\n",
            r"z \[furlong\]: expected a unit such as in z \[mm\], found furlong",
        ),
        ("x [mm],y [mm],z [mm],speeed\n1,2,3,fast\n4,5,6,7\n", "unknown column 'speeed'"),
        ("x [mm],y [mm],z [mm],feeed\n1,2,3,fast\n4,5,6,slow\n", "unknown column 'feeed'"),
        ("x [mm],y [mm],z [mm],A,B,C,rz [deg]\n1,2,3,0,0,0,5\n", "line 1: A: orientations are given twice"),
        ("x [mm],y [mm],z [mm],qw,qx,qy,qz\n1,2,3,1,0,0,0\n1,2,3,,,,\n", "line 3: qw …: found an empty cell"),
    ],
)
def test_columns_that_cannot_be_read_are_named(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "p.csv").write_text(text, encoding="utf-8")
    with pytest.raises(FileError, match=words):
        read_pose_table(tmp_path / "p.csv")


@pytest.mark.parametrize(
    ("names", "cells", "rows"),
    [  # what turns about which axis is by hand: the columns are where the tool's x, y, z point
        ("A,B,C", "90,0,90", [[0, 0, 1], [1, 0, 0], [0, 1, 0]]),
        ("W [deg],P [deg],R [deg]", "90,0,90", [[0, 0, 1], [1, 0, 0], [0, 1, 0]]),
        (
            "roll [rad],pitch [rad],yaw [rad]",
            f"{np.pi / 2},{np.pi / 2},0",
            [[0, 1, 0], [0, 0, -1], [-1, 0, 0]],
        ),
        ("A [deg],B [deg],C [deg]", "90,90,0", [[0, -1, 0], [0, 0, 1], [-1, 0, 0]]),
        ("qx,qy,qz,qw", "0,0,0.70710678,0.70710678", [[0, -1, 0], [1, 0, 0], [0, 0, 1]]),
        ("q1,q2,q3,q4", "0.70710678,0.70710678,0,0", [[1, 0, 0], [0, 0, -1], [0, 1, 0]]),
        (
            ",".join(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3)),
            "0,0,1,1,0,0,0,1,0",
            [[0, 0, 1], [1, 0, 0], [0, 1, 0]],
        ),
        (
            ",".join(f"R_{i}{j}" for j in (0, 1, 2) for i in (0, 1, 2)),
            "0,1,0,0,0,1,1,0,0",
            [[0, 0, 1], [1, 0, 0], [0, 1, 0]],
        ),
        ("nx,ny,nz,ox,oy,oz,ax,ay,az", "0,1,0,0,0,1,1,0,0", [[0, 0, 1], [1, 0, 0], [0, 1, 0]]),
    ],
)
def test_orientations_of_controllers_are_against_the_base(
    names: str, cells: str, rows: list[list[int]], tmp_path: Path
) -> None:
    (tmp_path / "p.csv").write_text(f"x [mm],y [mm],z [mm],{names}\n1,2,3,{cells}\n", encoding="utf-8")
    table = read_pose_table(tmp_path / "p.csv")
    turned = table.rotation(np.diag([1.0, -1.0, -1.0]))
    assert turned is not None and table.position.tolist() == [[0.001, 0.002, 0.003]]
    np.testing.assert_allclose(turned[0], rows, atol=1e-7)


@pytest.mark.parametrize(
    ("names", "by_columns"),
    [
        ([f"T{i}{j}" for i in range(4) for j in range(4)], False),
        ([f"T({i},{j})" for i in range(1, 5) for j in range(1, 5)], False),
        ([f"H[{i}][{j}]" for i in range(4) for j in range(4)], False),
        ([f"pose_{i}{j}" for i in range(3) for j in range(4)], False),
        ([f"M{k}" for k in range(1, 17)], False),
        ([f"O_T_EE_{k}" for k in range(16)], True),
        ([f"O_T_EE[{k}]" for k in range(16)], True),
    ],
)
def test_poses_are_homogeneous_matrices_too(names: list[str], by_columns: bool, tmp_path: Path) -> None:
    matrix = np.array([[0, 0, 1, 0.5], [1, 0, 0, -0.2], [0, 1, 0, 0.7], [0, 0, 0, 1]])
    matrices = np.array([matrix, np.eye(4)])
    cells = np.swapaxes(matrices, 1, 2) if by_columns else matrices[:, : len(names) // 4]
    rows = [",".join(map(str, c.ravel())) for c in cells]
    (tmp_path / "p.csv").write_text("\n".join([",".join(f'"{n}"' for n in names), *rows, ""]))
    table = read_pose_table(TableFile(tmp_path / "p.csv", units={"length": "m"}))
    turned = table.rotation(np.diag([1.0, -1.0, -1.0]))
    assert turned is not None
    np.testing.assert_allclose(table.position, matrices[:, :3, 3])
    np.testing.assert_allclose(turned, matrices[:, :3, :3], atol=1e-12)


def test_numbers_that_are_no_matrices_are_none(tmp_path: Path) -> None:
    names = [f"T{i}{j}" for i in range(4) for j in range(4)]
    (tmp_path / "p.csv").write_text(
        f"{','.join(names)}\n{','.join('0123456789123456')}\n{','.join('1123456789123457')}\n"
    )
    with pytest.raises(FileError, match="unknown column 'T00'"):
        read_pose_table(tmp_path / "p.csv")


SCOPE = (
    "Name\tscope\nStart\t1329\tMontag\n\nName\tX\tY\tZ\nSymbolComment\t\t\t\nData-Type\tREAL64\tREAL64\tREAL64\n"
    "SampleTime[ms]\t2\t2\t2\nSymbolName\tM.a\tM.b\tM.c\nOffset\t0\t0\t0\nBitMask\t0xff\t0xff\t0xff\n"
    "Unit\tcm (Length)\tcm (Length)\tcm (Length)\nUnit Offset\t0\t0\t0\n\n0\t5,05\t0\t70\n2\t0\t-2,025\t70\n"
)


@pytest.mark.parametrize("text", [SCOPE, SCOPE.replace("\t", ";")])
def test_lines_of_a_scope_between_names_and_numbers_say_the_units(text: str, tmp_path: Path) -> None:
    (tmp_path / "p.csv").write_text(text)
    found = read_pose_table(tmp_path / "p.csv")
    np.testing.assert_allclose(found.position, POINTS, atol=1e-15)
    assert found.values["t"].tolist() == [0.0, 0.002]


def test_numbers_of_columns_in_brackets_are_no_readings() -> None:
    plain = Spelling(False)
    assert [is_finite(c, plain) for c in ("0.33 + 0.42", "2*0.15", "-π/2")] == [True] * 3
    assert [is_finite(c, plain) for c in ("(3)", "90°", "1/2", "0 - 1")] == [False] * 4


@pytest.mark.parametrize(
    "text",
    [
        "Radius: 150 mm\nFeed: 1000 mm/min\nAngle (deg)\tRadial error (um)\tRun\n0\t1.5\t1\n30\t2.5\t1\n",
        "Temp: 20.1 C\nTarget\tX [mm]\tY [mm]\nSMR 1\t1,5\t2\nSMR 1\t2,5\t3\n",
    ],
)
def test_tabs_part_cells_that_have_blanks(text: str, tmp_path: Path) -> None:
    (tmp_path / "t.txt").write_text(text)
    t = read_sheet(tmp_path / "t.txt")
    assert len(t.header) == 3
    np.testing.assert_array_equal(t.numbers(1), [1.5, 2.5])


@pytest.mark.parametrize("between", [",", " ", "\t"])
@pytest.mark.parametrize("rows", [("1", "2"), ("5", "9"), ("pose 1", "pose 2")])
def test_row_names_in_quotes_need_no_header(between: str, rows: tuple[str, str], tmp_path: Path) -> None:
    lines = ['"x"', '"fx"'], [f'"{rows[0]}"', "0", "100.5"], [f'"{rows[1]}"', "1", "200.5"]
    (tmp_path / "r.txt").write_text("".join(between.join(cells) + "\n" for cells in lines))
    found = read_sheet(tmp_path / "r.txt")
    assert found.header == ("row", "x", "fx")
    assert found.numbers(2).tolist() == [100.5, 200.5]
    assert tuple(found.columns[0]) == rows


TIMES = "{0},fx [N],{1},dx [um]\n0,100,0,40\n1,200,{2},80\n2,300,{3},90\n"


@pytest.mark.parametrize(
    "names", [("X [ms]", "X [ms]"), ("Name", "Name"), ("Time 1", "Time 2"), ("t.1 [s]", "t.2 [s]"), ("", "")]
)
def test_channels_with_times_of_their_own_are_refused(names: tuple[str, str], tmp_path: Path) -> None:
    file = tmp_path / "scope.csv"
    file.write_text(TIMES.format(*names, 2, 4))
    with pytest.raises(FileError, match="where it is the time of each channel"):
        read_sheet(file)
    file.write_text(TIMES.format("Time 1", "Time 2", "1.0", 2))
    assert len(read_sheet(file)) == 3


def test_gauges_next_to_their_loads_are_no_times(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(TIMES.format("Gauge 1", "Gauge 2", 2, 4))
    assert len(read_sheet(tmp_path / "t.csv").header) == 4


@pytest.mark.parametrize("title", ["Deflection of the arm [um];;", "Verschiebung in um;;"])
def test_the_unit_of_a_title_of_one_quantity_is_none_of_all_columns(title: str, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(f"{title}\nx;fx;dx\n0;1;2\n1;2;3\n")
    assert read_sheet(tmp_path / "t.csv").header == ("x", "fx", "dx")
    (tmp_path / "t.csv").write_text(f"{title}\ndx;dy;dz\n0;1;2\n1;2;3\n")
    assert all("[" in h for h in read_sheet(tmp_path / "t.csv").header)


@pytest.mark.parametrize("name", ["a.LS", "a.mod", "a.src", "a.script"])
@pytest.mark.parametrize("reader", [read_sheet, read_pose_table, sm.load_machine, import_urdf])
def test_a_robots_program_is_said_to_be_one(
    reader: Callable[[Path], object], name: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_text("P[1] 1 2 3\n")
    with pytest.raises(FileError, match=r"a robot's program .* is not read; expected a machine file or URDF"):
        reader(tmp_path / name)


@pytest.mark.parametrize(
    ("encoding", "text"),
    [
        ("latin-1", "Größe Ø12 ±5 µm, déplacée, GRÖSSE, «ça», 10 °, Übung, Señal, é½"),
        ("gb18030", "序号，坐标X（毫米）力矩 误差±5 ℃ μ 激光跟踪仪"),
        ("utf-8", "坐标 Größe"),
    ],
)
def test_letters_are_those_of_their_encoding(encoding: str, text: str, tmp_path: Path) -> None:
    (tmp_path / "text").write_text(f"1\n{text}\n", encoding=encoding)
    assert text_of(tmp_path / "text") == f"1\n{text}\n"
