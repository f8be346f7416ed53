"""From a sheet as it lies in a workshop to an experiment."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.tables.header import split_unit
from stiffmap.common.tables.lines import Spelling, number
from stiffmap.common.tables.sheet import read_sheet
from stiffmap.experiment.spreadsheet.guess import guess
from stiffmap.ui.cli import main

GERMAN = """# Messprotokoll Fünfgelenk
Bediener;Meier;;;;;;
Nr;X [mm];Y [mm];Fx [N];Uhr 1 [µm];Uhr 2 [µm];Temp [°C];Bemerkung
1;0;416,0;100;351,5;352,1;20,5;ok
2;50,5;416,0;-100;-350,2;n/a;20,6;
3;0;450,0;1.000;-;3510,0;20,7;laut
"""


def write(folder: Path, name: str, text: str, encoding: str = "utf-8") -> str:
    (folder / name).write_bytes(text.encode(encoding))
    return str(folder / name)


def new(capsys: pytest.CaptureFixture[str], file: str, out: Path, *more: str) -> tuple[int, str, str]:
    code = main(["experiment", "new", file, "--machine", "five-bar", "-o", str(out), *more])
    told = capsys.readouterr()
    return code, told.out, told.err


CLOCKS = ("--map", "dx=Uhr 1|Uhr 2", "--set", "z=0", "--noise", "dx=2")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_semicolons_commas_and_repeats(
    encoding: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write(tmp_path, "uhr.csv", GERMAN, encoding)
    code, out, err = new(capsys, file, tmp_path / "e", *CLOCKS)
    assert (code, err) == (0, "")
    assert "'Uhr 2 [µm]': repeat 2 of dx, um" in out and "'Bemerkung': kept in notes.csv" in out
    assert "z = 0 in every row" in out and "4 rows of deflection at 3 poses" in out
    e = sm.load_experiment(tmp_path / "e")
    np.testing.assert_allclose(e.reading[:, 0], [351.5e-6, 352.1e-6, -350.2e-6, 3510e-6])
    np.testing.assert_allclose(e.position[:, 0], [0, 0, 0.0505, 0])
    np.testing.assert_allclose(e.wrench[:, 0], [100, 100, -100, 1000])
    np.testing.assert_allclose(e.sigma[:, 0], 2e-6)
    assert e.repeat is not None and e.repeat.tolist() == [1, 2, 1, 2]
    assert e.ids == ("1.1", "1.2", "2.1", "3.2")
    assert "laut" in (tmp_path / "e/notes.csv").read_text(encoding="utf-8")


def test_a_workbook_reads_as_its_text(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    page = book.active
    page.append(["Messprotokoll"])
    page.append(["Nr", "X [mm]", "Y [mm]", "Fx [N]", "Uhr 1 [µm]", "Uhr 2 [µm]", "Temp [°C]", "Bemerkung"])
    page.append([1, 0, 416.0, 100, 351.5, 352.1, 20.5, "ok"])
    page.append([2, 50.5, 416.0, -100, -350.2, "n/a", 20.6, None])
    page.append([3, 0, 450.0, 1000, None, 3510.0, 20.7, "laut"])
    book.save(tmp_path / "uhr.xlsx")
    assert new(capsys, str(tmp_path / "uhr.xlsx"), tmp_path / "a", *CLOCKS)[0] == 0
    assert new(capsys, write(tmp_path, "uhr.csv", GERMAN), tmp_path / "b", *CLOCKS)[0] == 0
    one, other = (sm.load_experiment(tmp_path / f) for f in "ab")
    np.testing.assert_array_equal(one.reading, other.reading)
    np.testing.assert_array_equal(one.position, other.position)
    assert main(["experiment", "new", str(tmp_path / "uhr.xlsx"), "--machine", "five-bar", "--sheet", "Q",
                 "-o", str(tmp_path / "c")]) == 2  # fmt: skip
    assert "no sheet 'Q'; there are: Sheet" in capsys.readouterr().err


def test_the_next_command_is_one_that_is_not_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = "x [mm],y [mm],z [mm],fx [N],dx [um],dy [um]\n0,416,0,10,5,7\n0,420,0,10,5,7\n"
    file, out = write(tmp_path, "t.csv", text), tmp_path / "e"
    last = new(capsys, file, out)[1].splitlines()[-1]
    assert last.startswith("next: stiffmap experiment new") and "--noise dx=<one sigma in um>" in last
    words = last.replace("<one sigma in um>", "1").split()[2:]
    assert main(words) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last == f"next: stiffmap residual five-bar {out}"
    assert main(last.split()[2:]) in (0, 1)
    same = text + "0,420,0,10,5.1,7.1\n" * 5  # repeats show the noise
    assert "next: stiffmap residual" in new(capsys, write(tmp_path, "r.csv", same), tmp_path / "r")[1]


def test_everything_may_be_guessed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = "id\tx (mm)\ty (mm)\tz (mm)\tFx (kN)\tdx 1 (µm)\tdx 2 (µm)\tdy 1 (µm)\tdy 2 (µm)\n1\t0\t400\t0\t0.1\t5\t6\t7\t8\n"
    code, out, _ = new(capsys, write(tmp_path, "t.txt", text), tmp_path / "e", "--json")
    assert code == 0
    data = json.loads(out)
    assert data["repeats"] == 2 and data["columns"]["dy 2 (µm)"] == "dy" and data["units"]["fx"] == "kN"
    e = sm.load_experiment(tmp_path / "e")
    np.testing.assert_allclose(e.reading[:, :2], [[5e-6, 7e-6], [6e-6, 8e-6]])
    assert e.wrench[0, 0] == 100.0


@pytest.mark.parametrize(
    ("text", "more", "words"),
    [
        ("a;b\n1;2\n", (), "which column is the position x? Say --map x='HEADER'"),
        ("x [mm];y [mm];q\n1;2;3\n", ("--set", "z=0"), "which column is a reading? Say --map dx='HEADER'"),
        ("x;y;Z;fx;dx\n1;2;3;4;5\n", ("--set", "z=0"), "--set z: column 'Z' says it row by row"),
        (
            "x;y;z;load;direction;dx\n1;2;3;4;+z;5\n",
            ("--set", "fz=1"),
            "--set fz: column '+load along z' says",
        ),
        (
            "x [mm];y [mm];dx\n1;2;3\n",
            ("--set", "z=0"),
            "column 'dx' (dx) has no unit: write it in the header",
        ),
        ("x [mm];y [mm];dx [N]\n1;2;3\n", ("--set", "z=0"), "the unit 'N' is not one of this quantity"),
        (
            "x [mm];y [mm];dx [mm]\n1;2;3\n1;2;oops\n",
            ("--set", "z=0"),
            "line 3: column 'dx [mm]': expected a number",
        ),
        ("x [mm];y [mm];fx [mN];dx [mm]\n1;2;3;4\n", ("--set", "z=0"), "the unit 'mN' is not one of"),
        ("only words\n", (), "no header line"),
        ("x [mm];y [mm];dx [mm]\n1;2;3\n", ("--map", "dz=Uhr"), "t.csv: --map: no column 'Uhr'"),
        (
            "x [mm];y [mm];dx [mm]\n1;2;3\n",
            ("--map", "dz"),
            "expected NAME=VALUE, such as --map x='X pos', each",
        ),
        *(
            (
                "x [mm];y [mm];dx [mm]\n1;2;3\n",
                (name, "0.03"),
                f"such as {name} {said}, each name once; got '0.03'",
            )
            for name, said in (
                ("--noise", "dx=0.03"),
                ("--set", "z=0"),
                ("--unit", "x=um"),
                ("--record", "operator=Miller"),
            )
        ),
    ],
)
def test_questions_and_errors_are_one_line(
    text: str, more: tuple[str, ...], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = new(capsys, write(tmp_path, "t.csv", text), tmp_path / "e", *more)
    assert (code, out) == (2, "")
    assert words in err and err.count("\n") == 1


def test_an_experiment_is_not_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = write(tmp_path, "uhr.csv", GERMAN)
    assert new(capsys, file, tmp_path / "e", *CLOCKS)[0] == 0
    assert "--overwrite" in new(capsys, file, tmp_path / "e", *CLOCKS)[2]
    assert new(capsys, file, tmp_path / "e", *CLOCKS, "--overwrite")[0] == 0


def test_pieces() -> None:
    assert split_unit("Uhr 1 [µm]") == ("Uhr 1", "µm") and split_unit("x / mm") == ("x", "mm")
    assert split_unit("left/right") == ("left/right", "")
    for header in ("x / mm", "x, mm", "x in mm", "x_mm", "x mm", "x(mm)"):
        assert split_unit(header) == ("x", "mm"), header
    assert split_unit("point in") == ("point in", "") and split_unit("load in N") == ("load", "N")
    meant = [(c.meaning, c.repeat, c.unit) for c in guess(["Force x, kN", "gauge x 1 [µm]", "Messuhr y"], {})]
    assert meant == [("fx", 0, "kN"), ("dx", 1, "µm"), ("dy", 0, "")]
    assert (
        number("1.234,5", Spelling(comma=True)) == 1234.5
        and number("1,5", Spelling()) is None
        and np.isnan(number("n/a", Spelling()) or 0)
    )
    assert [c.meaning for c in guess(["X", "Kraft z [N]", "Abweichung y", "Foo"], {})] == [
        "x",
        "fz",
        "dy",
        "note",
    ]


def test_the_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(sm.StiffmapError, match="cannot be read"):
        read_sheet(tmp_path / "no.csv")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x,y,dx\n1,2," + "9" * 200_000 + "\n", "line 2: is no table: field larger"),
        (
            "x,y," + "d(" * 5000 + "\n1,2,3\n",
            "at most 1000 columns of 300 characters each; found one of 10000",
        ),
        ("x," * 5000 + "y\n" + "1," * 5000 + "2\n", "found 5001 columns"),
    ],
)
def test_endless_cells_are_refused_at_once(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "t.csv").write_text(text)
    with pytest.raises(sm.StiffmapError, match=words):
        read_sheet(tmp_path / "t.csv")


@pytest.mark.parametrize(
    ("headers", "chosen", "meanings"),
    [
        (["coordinate x", "coordinate y", "MODEL_X", "MODEL_Y", "MODEL_Z"], {"z": ["MODEL_Z"]}, {"z"}),
        (["dx", "dy", "cam dx", "cam dy"], {"dx": ["cam dx"]}, {"dx"}),
        (["x", "y", "height"], {"z": ["height"]}, {"x", "y", "z"}),
        (["Fx", "Fy", "Channel Z"], {"fz": ["Channel Z"]}, {"fx", "fy", "fz"}),
    ],
)
def test_axes_next_to_a_chosen_column_are_not_taken_from_another_set(
    headers: list[str], chosen: dict[str, list[str]], meanings: set[str]
) -> None:
    assert {c.meaning for c in guess(headers, chosen)} - {"note"} == meanings
