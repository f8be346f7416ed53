"""Excel workbooks: what is in them is bounded, and what is damaged is said in one line."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any
from zipfile import ZipFile

from stiffmap.common.errors import FileError, MissingPartError

MOST_CELLS = 30_000_000
"""Of a sheet, blank ones between included: one cell far out would make as many as the sheet can have."""
MOST_BYTES = 200_000_000
"""Of a workbook when it is unpacked; a megabyte of blanks or repeats unpacks to a thousand."""
FORMULA = re.compile(rb"<(\w+:)?f[ />]")
"""In the XML of a sheet."""
LONGEST_GAP = 10_000
"""Blank lines after which a sheet is at its end."""


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
    try:
        from openpyxl import load_workbook
    except ModuleNotFoundError:
        raise MissingPartError(
            f"{path}: reading Excel files needs openpyxl, which is not installed: pip install openpyxl "
            "(or save the sheet as CSV)"
        ) from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of styles and extensions, which nobody asked for
            with ZipFile(path) as packed:
                parts = packed.infolist()
                size = sum(part.file_size for part in parts)
                if size > MOST_BYTES:
                    raise FileError(
                        f"expected at most {MOST_BYTES / 1e6:g} MB when unpacked; found {size / 1e6:.0f} MB; "
                        "save the sheet as CSV",
                        file=str(path),
                    )
                computes = any(FORMULA.search(packed.read(p)) for p in parts if "sheet" in p.filename)
            book = load_workbook(path, data_only=True, read_only=True)
            names = book.sheetnames
            if not names:
                raise ValueError("it has no sheet")
            if sheet and sheet not in names:
                raise FileError(f"no sheet '{sheet}'; there are: {', '.join(names)}", file=str(path))
            lines = [] if sheet is None else _lines(book[sheet or names[0]], path)
            if computes and sheet is not None:
                _check_values(load_workbook(path, read_only=True)[sheet or names[0]], dict(lines), path)
    except (FileError, MemoryError):
        raise
    except FileNotFoundError:
        raise FileError("there is no such file", file=str(path)) from None
    except Exception as error:  # many kinds for what is no workbook, or a damaged one
        what = " ".join(str(error).split()) or type(error).__name__
        raise FileError(f"cannot be read as an Excel workbook ({what})", file=str(path)) from error
    return names, lines


def _lines(page: Any, path: Path) -> list[tuple[int, list[str]]]:
    if not hasattr(page, "iter_rows"):
        raise ValueError("the sheet is a chart")
    page.reset_dimensions()  # what the file says of them may be wrong; each row is then as long as its last cell
    out: list[tuple[int, list[str]]] = []
    cells = 0
    for n, row in enumerate(page.iter_rows(values_only=True), 1):
        if all(v is None for v in row):
            continue
        if n - (out[-1][0] if out else 0) > LONGEST_GAP:
            raise FileError(
                f"expected a table without gaps; found cells behind more than {LONGEST_GAP} blank lines",
                file=str(path),
                line=n,
            )
        cells += len(row)
        if cells > MOST_CELLS:
            raise FileError(f"expected at most {MOST_CELLS} cells; found more", file=str(path), line=n)
        out.append((n, ["" if v is None else repr(v) if isinstance(v, float) else str(v) for v in row]))
    return out


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
