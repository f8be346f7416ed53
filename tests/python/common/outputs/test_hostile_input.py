"""What ended as "a defect of stiffmap": numbers out of range, damaged workbooks, odd encodings."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from stiffmap.common.errors import FileError
from stiffmap.common.number_text import number_in
from stiffmap.common.tables.cells import BETWEEN, BLOCK, Cells, packed
from stiffmap.common.tables.sheet import read_sheet
from stiffmap.ui.cli import main

from ...experiment.spreadsheet.ugly import open_document

DATA = Path(__file__).parents[4] / "tests/data/experiments/C-backlash"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["simulate", "five-bar", "-o", "s", "--seed", "-1"], "seed: expected 0 or more, got -1"),
        (["diagnose", "orthoglide-revised", str(DATA), "--seed", "-1"], "seed: expected 0 or more, got -1"),
        (["calibrate", "orthoglide-revised", str(DATA), "--seed", "-1"], "seed: expected 0 or more, got -1"),
        (
            ["map", "five-bar", "--points", "2", "--threads", "1000000000", "-o", "m"],
            "threads: expected at most 4096",
        ),
        (["map", "five-bar", "--points", "-3", "-o", "m"], "points: expected 1 or more, got -3"),
    ],
)
def test_numbers_out_of_range(
    words: list[str],
    message: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(words) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize("count", ["-1", "0"])
def test_generations(count: str, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    pytest.importorskip("pymoo")
    assert main(["optimize", "redesign", "-o", str(tmp_path / "o"), "--generations", count]) == 2
    assert f"generations: expected 1 or more, got {count}" in capsys.readouterr().err


def test_an_instruction_set_that_there_is_not() -> None:
    done = subprocess.run([sys.executable, "-m", "stiffmap", "solve", "five-bar"], env={**os.environ, "STIFFMAP_ISA": "nix"},
                          capture_output=True, text=True, check=False)  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.startswith("stiffmap: STIFFMAP_ISA: expected a level of this processor")


@pytest.mark.parametrize(
    "raw",
    [
        b'<?xml version="1.0" encoding="nix"?><robot name="a"/>', b'<?xml version="1.0" encoding="utf-16"?><robot name="a"/>',
        b'<?xml version="1.0" encoding="utf-7"?><robot name="a"/>', b"\xff\xfe<robot", b"", b"\0",
        b'<?xml version="1.0" encoding="idna"?><robot name="a"/>',
    ],
)  # fmt: skip
def test_urdf_encodings(raw: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.urdf").write_bytes(raw)
    assert main(["import", str(tmp_path / "a.urdf"), "-o", str(tmp_path / "a.yaml")]) == 2
    assert "a.urdf" in capsys.readouterr().err


def workbook(path: Path, cells: dict[str, object]) -> Path:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for place, value in cells.items():
        book.active[place] = value
    book.save(path)
    return path


TABLE = {"A1": "x", "B1": "dx", "A2": 1, "B2": 0.5, "A3": 2.5, "B3": 1}


def rewritten(path: Path, change: Callable[[str, bytes], bytes | None]) -> None:
    """The workbook with the bytes of its parts changed; None leaves a part out."""
    with zipfile.ZipFile(path) as book:
        parts = {n: book.read(n) for n in book.namelist()}
    with zipfile.ZipFile(path, "w") as book:
        for name, raw in parts.items():
            if (new := change(name, raw)) is not None:
                book.writestr(name, new)


DAMAGES: dict[str, Callable[[str, bytes], bytes | None]] = {
    "cut sheet": lambda n, raw: raw[: len(raw) // 2] if "sheet1" in n else raw,
    "no sheet": lambda n, raw: None if "sheet1" in n else raw,
    "bad reference": lambda n, raw: raw.replace(b'r="B2"', b'r="??"') if "sheet1" in n else raw,
    "bad row": lambda n, raw: raw.replace(b'<row r="2"', b'<row r="x"') if "sheet1" in n else raw,
    "bad number": lambda n, raw: raw.replace(b"<v>0.5</v>", b"<v>nix</v>") if "sheet1" in n else raw,
    "cut workbook": lambda n, raw: raw[:100] if n == "xl/workbook.xml" else raw,
    "no content types": lambda n, raw: None if "Content_Types" in n else raw,
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_workbooks(damage: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = workbook(tmp_path / "a.xlsx", TABLE)
    assert len(read_sheet(path).lines) == 2
    rewritten(path, DAMAGES[damage])
    with pytest.raises(FileError, match=r"a\.xlsx.*cannot be read as a workbook"):
        read_sheet(path)
    assert main(["experiment", "new", str(path), "--machine", "five-bar", "-o", str(tmp_path / "e")]) == 2
    assert "defect" not in capsys.readouterr().err


@pytest.mark.parametrize(
    "row",
    [
        '<table:table-row table:number-rows-repeated="100000">{}</table:table-row>',
        "<table:table-row>{}</table:table-row>" * 6000,
    ],
)
def test_cells_that_repeat_themselves_without_end_are_refused(row: str, tmp_path: Path) -> None:
    pytest.importorskip("python_calamine")
    cell = (
        '<table:table-cell table:number-columns-repeated="6000" office:value-type="float" office:value="1"/>'
    )
    path = open_document(tmp_path / "a.ods", [["x", "dx"], ["1", "0.5"]], "{}" + row.format(*[cell] * 6000))
    with pytest.raises(FileError, match=r"a\.ods.*expected at most 30000000 cells"):
        read_sheet(path)


def test_a_cell_far_out_of_an_open_document_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("python_calamine")
    below = '<table:table-row table:number-rows-repeated="1000000"><table:table-cell/></table:table-row>'
    aside = '<table:table-cell table:number-columns-repeated="16000"/><table:table-cell office:value-type="float" office:value="1"/>'
    rows = "{}" + below + f"<table:table-row>{aside}</table:table-row>"
    path = open_document(tmp_path / "a.ods", [["x", "dx"], ["1", "0.5"]], rows)
    with pytest.raises(FileError, match=r"a\.ods"):
        read_sheet(path)


def test_a_damaged_open_document(tmp_path: Path) -> None:
    pytest.importorskip("python_calamine")
    path = open_document(tmp_path / "a.ods", [["x", "dx"], ["1", "0.5"], ["2", "1"]])
    sheet = read_sheet(path)
    assert (
        sheet.header == ("x", "dx") and list(sheet.lines) == [2, 3] and list(sheet.columns[0]) == ["1", "2"]
    )
    with pytest.raises(FileError, match=r"a\.ods.*no sheet 'Other'; there are: Data"):
        read_sheet(path, "Other")
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(FileError, match=r"a\.ods.*cannot be read as a workbook"):
        read_sheet(path)


def test_one_cell_far_out_costs_nothing(tmp_path: Path) -> None:
    path = workbook(tmp_path / "a.xlsx", TABLE)
    rewritten(path, lambda n, raw: raw.replace(b"</sheetData>", b'<row r="1048576"><c r="XFD1048576"><v>1</v></c></row></sheetData>')
              if "sheet1" in n else raw)  # fmt: skip
    with pytest.raises(FileError, match="line 1048576: expected a table without gaps"):
        read_sheet(path)


@pytest.mark.parametrize("raw", [b"\xff\xfea", b"\xfe\xff\xd8\x00\x00a", b"\xff\xfe\x00\xdc\x00\xdc"])
def test_text_that_is_no_utf_16(raw: bytes, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(raw)
    with pytest.raises(FileError, match=r"a\.csv: begins as UTF-16 and is none"):
        read_sheet(tmp_path / "a.csv")


def test_packed_cells_are_those_that_went_in() -> None:
    rows = [[f" a{i} ", str(i), f"x{BETWEEN}y" if i % 7 == 0 else ""] for i in range(2 * BLOCK + 5)]
    (one, two, three), lines = packed(enumerate(rows, 5), 3)
    assert lines[0] == 5 and len(lines) == len(rows)
    assert list(one) == [r[0].strip() for r in rows] and len(one) == len(rows)
    np.testing.assert_array_equal(two.numbers(lambda *_: 1 / 0), np.arange(len(rows)))
    assert list(three)[:8] == ["x y", *[""] * 6, "x y"]


@pytest.mark.parametrize("odd", ["1_0", "", "nan", "inf", "1e999", "nix", "１"])
def test_odd_cells_are_read_one_by_one(odd: str) -> None:
    asked = []

    def one(cell: str, row: int) -> float:
        asked.append((cell, row))
        return -1.0 if cell == odd else number_in(cell)

    out = Cells.of(["1", "2.5", odd, "-3e2"]).numbers(one)
    assert (odd, 2) in asked and out.tolist() == [1.0, 2.5, -1.0, -300.0]


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("1.000;2,5\n-1.234,5;0", [[1000, 2.5], [-1234.5, 0]]),
        ("−1,5;1\u00a0000,5\n2;3,25", [[-1.5, 1000.5], [2, 3.25]]),
    ],
)
def test_decimal_commas_and_thousands(text: str, wanted: list[list[float]], tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(f"x;y\n{text}\n", encoding="utf-8")
    sheet = read_sheet(tmp_path / "a.csv")
    assert sheet.decimal_comma
    np.testing.assert_array_equal(np.column_stack([sheet.numbers(0), sheet.numbers(1)]), wanted)
