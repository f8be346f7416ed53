"""Workbooks: formulas without values, and files that unpack to far more than they are."""

from __future__ import annotations

import time
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import pytest

from stiffmap.common.errors import FileError
from stiffmap.common.tables.workbook import sheet_names, workbook_lines

openpyxl = pytest.importorskip("openpyxl")


def workbook(path: Path, *rows: list[object]) -> Path:
    """A workbook of one sheet, as a program writes it that computes no formula."""
    book = openpyxl.Workbook()
    book.active.title = "readings"
    for row in rows:
        book.active.append(row)
    book.save(path)
    return path


@pytest.mark.parametrize(
    ("rows", "cell"),
    [
        ([["x", "fx"], [1, 2], ["=A2+1", "=B2"]], "A3"),
        ([["x", "fx"], [1, 2], [3, "=B2*2"]], "B3"),
        ([["x", "fx"], [1, "=SUM(A2)"], [3, 4]], "B2"),
        ([["=A2", "fx"], [1, 2]], "A1"),
        ([["x"], ["=1"], [3], ["=2"]], "A2"),
    ],
)
def test_a_formula_without_a_value_is_named(rows: list[list[object]], cell: str, tmp_path: Path) -> None:
    path = workbook(tmp_path / "b.xlsx", *rows)
    with pytest.raises(FileError, match=f"line {cell[1]}: sheet 'readings', cell {cell}: the formula"):
        workbook_lines(path, None)


def test_numbers_and_blanks_are_read_as_before(tmp_path: Path) -> None:
    path = workbook(tmp_path / "b.xlsx", ["x", None, "note"], [1.5, None, None], [None], [2, 3, "a"])
    name, lines = workbook_lines(path, None)
    assert name == "readings"
    assert [n for n, _ in lines()] == [1, 2, 4]


@pytest.mark.parametrize(
    "part", ["xl/worksheets/sheet2.xml", "xl/media/image.png", "docProps/more.xml", "other.bin"]
)
def test_what_unpacks_to_too_much_is_refused_at_once(part: str, tmp_path: Path) -> None:
    path = workbook(tmp_path / "b.xlsx", ["x"], [1])
    with ZipFile(path, "a", ZIP_DEFLATED) as packed, packed.open(part, "w", force_zip64=True) as file:
        for _ in range(201):
            file.write(b" " * 1_000_000)
    assert path.stat().st_size < 2e6
    started = time.process_time()
    for call in (lambda: sheet_names(path), lambda: workbook_lines(path, None)):
        with pytest.raises(FileError, match="at most 200 MB when unpacked; found 201 MB"):
            call()
    assert time.process_time() - started < 1.0


@pytest.mark.parametrize("last", [2, 3, 5])
def test_a_header_reaches_as_far_as_the_rows_below_it(last: int, tmp_path: Path) -> None:
    """Merged cells behind its first one are none in the file."""
    book = openpyxl.Workbook()
    book.active.append(["x [mm]", "dx [mm]"])
    book.active.append([1.5] * last)
    if last > 2:
        book.active.merge_cells(start_row=1, end_row=1, start_column=2, end_column=last)
    book.save(tmp_path / "merged.xlsx")
    lines = [cells for _, cells in workbook_lines(tmp_path / "merged.xlsx", None)[1]()]
    assert lines[0] == ["x [mm]", "dx [mm]", *[""] * (last - 2)]


def test_covers_and_charts_before_the_table(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    from openpyxl.chart import LineChart, Reference

    from stiffmap.common.tables.sheet import read_sheet

    book = openpyxl.Workbook()
    book.active["A1"] = "Protocol"
    page = book.create_sheet("Data")
    for row in (["x [mm]", "y [mm]"], [1, 2], [3, 4]):
        page.append(row)
    chart = LineChart()
    chart.add_data(Reference(page, min_col=1, min_row=1, max_row=3))
    book.create_chartsheet("Chart", 0).add_chart(chart)
    book.save(tmp_path / "b.xlsx")
    assert list(read_sheet(tmp_path / "b.xlsx").numbers(1)) == [2, 4]
