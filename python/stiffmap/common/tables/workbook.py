"""Workbooks (xlsx, xlsm, xls, ods): what is in them is bounded, and what is damaged is said in one line."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any
from zipfile import ZipFile

from stiffmap.common.errors import FileError, MissingPartError, needed

MOST_CELLS = 30_000_000
"""Of a sheet, blank ones between included: one cell far out would make as many as the sheet can have."""
MOST_BYTES = 200_000_000
"""Of a workbook when it is unpacked; a megabyte of blanks or repeats unpacks to a thousand."""
FORMULA = re.compile(rb"<(\w+:)?f[ />]")
"""In the XML of a sheet."""
ROW = re.compile(rb"<table:table-row\b([^>]*)(?<!/)>(.*?)</table:table-row>", re.DOTALL)
CELL = re.compile(rb"<table:table-cell\b([^>]*value-type[^>]*)>")
TIMES = re.compile(rb'number-(?:rows|columns)-repeated="(\d+)"')
"""In the XML of an OpenDocument sheet: a row, a cell that is filled, how often they are repeated."""
WHOLE = 1e15
"""Numbers below it without decimals are written so: most workbooks do not tell 1 from 1.0."""
LONGEST_GAP = 10_000
"""Blank lines after which a sheet is at its end."""
EXCEL = (".xlsx", ".xlsm")
WORKBOOKS = (*EXCEL, ".xls", ".ods")
"""Suffixes."""
TABLES = (".csv", ".tsv", *WORKBOOKS)
"""Suffixes of files that are tables whatever stands in them."""
OTHERWISE = " (or save the sheet as CSV)"


def sheet_names(path: Path) -> list[str]:
    """Names of the sheets of a workbook. Raises FileError."""
    return _opened(path, None)[0]


def workbook_lines(
    path: Path, sheet: str | None
) -> tuple[str, Callable[[], Iterable[tuple[int, list[str]]]]]:
    """Name of a sheet (the first one, or the named one), and number and cells of each of its lines. Raises FileError."""
    names, lines = _opened(path, sheet or "")
    return sheet or names[0], lambda: lines


def _opened(path: Path, sheet: str | None) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Names of all sheets, and lines of one of them: the first for an empty name, of none for None."""
    read = _by_openpyxl if path.suffix.lower() in EXCEL else _by_calamine
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of styles and extensions, which nobody asked for
            return read(path, sheet)
    except (FileError, MissingPartError, MemoryError):
        raise
    except FileNotFoundError:
        raise FileError("there is no such file", file=str(path)) from None
    except Exception as error:  # many kinds for what is no workbook, or a damaged one
        what = " ".join(str(error).split()) or type(error).__name__
        raise FileError(f"cannot be read as a workbook ({what})", file=str(path)) from error


def _by_openpyxl(path: Path, sheet: str | None) -> tuple[list[str], list[tuple[int, list[str]]]]:
    with needed(f"{path}: reading {path.suffix} files", "excel", OTHERWISE):
        from openpyxl import load_workbook
    computes = any(FORMULA.search(part) for part in _parts(path, "sheet"))
    book = load_workbook(path, data_only=True, read_only=True)
    names = [page.title for page in book.worksheets]  # not those that are charts
    page = _chosen(names, sheet, path)
    lines = [] if page is None else _lines(_rows(book[page]), path)
    if computes and page is not None:
        _check_values(load_workbook(path, read_only=True)[page], dict(lines), path)
    return names, lines


def _by_calamine(path: Path, sheet: str | None) -> tuple[list[str], list[tuple[int, list[str]]]]:
    with needed(f"{path}: reading {path.suffix} files", "excel", OTHERWISE):
        from python_calamine import CalamineWorkbook
    if path.suffix.lower() == ".ods":
        rows_of = (row for content in _parts(path, "content.xml") for row in ROW.findall(content))
        cells = sum(_times(row) * sum(map(_times, CELL.findall(body))) for row, body in rows_of)
        if cells > MOST_CELLS:
            raise FileError(f"expected at most {MOST_CELLS} cells; found {cells}", file=str(path))
    book = CalamineWorkbook.from_path(str(path))
    page = _chosen(book.sheet_names, sheet, path)
    rows = [] if page is None else book.get_sheet_by_name(page).to_python(skip_empty_area=False)
    return book.sheet_names, _lines(([None if v == "" else v for v in row] for row in rows), path)


def _parts(path: Path, word: str) -> Iterator[bytes]:
    """What is packed in a workbook under names with a word in them."""
    with ZipFile(path) as packed:
        size = sum(part.file_size for part in packed.infolist())
        if size > MOST_BYTES:
            raise FileError(
                f"expected at most {MOST_BYTES / 1e6:g} MB when unpacked; found {size / 1e6:.0f} MB; "
                "save the sheet as CSV",
                file=str(path),
            )
        yield from (packed.read(part) for part in packed.infolist() if word in part.filename)


def _times(attributes: bytes) -> int:
    found = TIMES.search(attributes)
    return int(found[1]) if found else 1


def _chosen(names: list[str], sheet: str | None, path: Path) -> str | None:
    """The sheet to read: the named one, or the first for an empty name; None for None."""
    if not names:
        raise ValueError("it has no sheet")
    if sheet and sheet not in names:
        raise FileError(f"no sheet '{sheet}'; there are: {', '.join(names)}", file=str(path))
    return None if sheet is None else sheet or names[0]


def _rows(page: Any) -> Iterable[Sequence[object]]:
    page.reset_dimensions()  # what the file says of them may be wrong; each row is then as long as its last cell
    return page.iter_rows(values_only=True)  # type: ignore[no-any-return]


def _lines(rows: Iterable[Sequence[object]], path: Path) -> list[tuple[int, list[str]]]:
    """Number, from 1, and cells of the lines that have any."""
    out: list[tuple[int, list[str]]] = []
    cells = 0
    for n, row in enumerate(rows, 1):
        if all(v is None for v in row):
            continue
        if n - (out[-1][0] if out else 0) > LONGEST_GAP:
            what = f"expected a table without gaps; found cells behind more than {LONGEST_GAP} blank lines"
            raise FileError(what, file=str(path), line=n)
        cells += len(row)
        if cells > MOST_CELLS:
            raise FileError(f"expected at most {MOST_CELLS} cells; found more", file=str(path), line=n)
        if out:  # as far as the next one: merged cells behind its last are none to this reader
            out[-1][1].extend([""] * (len(row) - len(out[-1][1])))
        out.append((n, [_text(v) for v in row]))
    return out


def _text(value: object) -> str:
    if isinstance(value, float):
        return str(int(value)) if value.is_integer() and abs(value) < WHOLE else repr(value)
    return "" if value is None else str(value)


def _check_values(page: Any, lines: dict[int, list[str]], path: Path) -> None:
    """FileError where a formula has no value: nothing has computed it since it was written."""
    page.reset_dimensions()
    for n, row in enumerate(page.iter_rows(), 1):
        kept = lines.get(n, [])
        for i, cell in enumerate(row):
            if cell.data_type == "f" and not (i < len(kept) and kept[i]):
                raise FileError(
                    f"sheet '{page.title}', cell {cell.coordinate}: the formula {cell.value} has no value; open the "
                    "workbook in a spreadsheet program and save it, or write the number",
                    file=str(path), line=n,
                )  # fmt: skip
