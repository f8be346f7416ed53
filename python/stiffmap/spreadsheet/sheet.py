"""A spreadsheet or text table as it lies in a workshop: cells as text, header found, numbers read."""

from __future__ import annotations

import csv
import io
import math
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from stiffmap.errors import FileError, MissingPartError
from stiffmap.number_text import number_in

EXCEL = (".xlsx", ".xlsm")
NOTHING = {"", "-", "--", "–", "na", "n/a", "n.a.", "nan", "none", "null", "#n/a"}
COMMENTS = ("#", "%", "//")
LONGEST_HEADER, MOST_COLUMNS = 300, 1000
SEPARATORS = ";\t|,"
THOUSANDS = re.compile(r"[+-]?\d{1,3}(\.\d{3})+")
"""``1.000`` is a thousand in a table with decimal commas."""


@dataclass(frozen=True)
class Sheet:
    """Header and rows of a table; cells are text, numbers with a decimal point."""

    file: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    """Line of each row in the file, from 1."""
    decimal_comma: bool

    def numbers(self, column: int) -> list[float]:
        """A column; NaN where nothing was read. FileError names the line of what is no number."""
        return [
            self._number(row[column], column, line) for row, line in zip(self.rows, self.lines, strict=True)
        ]

    def _number(self, cell: str, column: int, line: int) -> float:
        value = number(cell, self.decimal_comma)
        if value is None:
            raise FileError(
                f"column '{self.header[column]}': expected a number; found {cell!r}",
                file=self.file,
                line=line,
            )
        return value

    def is_numeric(self, column: int) -> bool:
        """Whether all cells of a column are numbers or say that nothing was read."""
        return all(number(row[column], self.decimal_comma) is not None for row in self.rows)


def number(cell: str, decimal_comma: bool) -> float | None:
    """The number in a cell; NaN for nothing, None for text."""
    text = cell.strip().replace("\u00a0", "").replace("−", "-")
    if text.lower() in NOTHING:
        return math.nan
    if decimal_comma and ("," in text or THOUSANDS.fullmatch(text)):
        text = text.replace(".", "").replace(",", ".")
    try:
        value = number_in(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def read_sheet(path: Path, sheet: str | None = None) -> Sheet:
    """Cells of an Excel workbook (its first sheet, or the named one) or of a text table.

    Text: separators ; tab | , and decimal points or commas are found out, UTF-8, UTF-16 and Latin-1 are read.
    Comment lines are skipped; the header is the line before the first row of mostly numbers. Raises FileError.
    """
    lines = _excel(path, sheet) if path.suffix.lower() in EXCEL else _text(path)
    kept = [(n, c) for n, c in lines if any(x.strip() for x in c) and not c[0].strip().startswith(COMMENTS)]
    comma = _decimal_comma([c for _, c in kept])
    start = next((i for i, (_, c) in enumerate(kept) if i and _is_data(c, comma)), None)
    if start is None:
        raise FileError("no header line with rows of numbers below it was found", file=str(path))
    header = [re.sub(r"\s+", " ", c.strip()) for c in kept[start - 1][1]]
    endless = next((c for c in header if len(c) > LONGEST_HEADER), None)
    if endless is not None or len(header) > MOST_COLUMNS:
        what = f"{len(header)} columns" if endless is None else f"one of {len(endless)} characters"
        raise FileError(
            f"expected a header of at most {MOST_COLUMNS} columns of {LONGEST_HEADER} characters each; found {what}",
            file=str(path),
            line=kept[start - 1][0],
        )
    width = max(i for i, c in enumerate(header) if c) + 1
    rows = [(n, tuple(x.strip() for x in (*c, *[""] * width)[:width])) for n, c in kept[start:]]
    names = [h or f"column {i + 1}" for i, h in enumerate(header[:width])]
    twice = sorted(h for h, n in Counter(names).items() if n > 1)
    if twice:
        raise FileError(f"column '{twice[0]}' occurs twice", file=str(path), line=kept[start - 1][0])
    return Sheet(str(path), tuple(names), tuple(r for _, r in rows), tuple(n for n, _ in rows), comma)


def _is_data(cells: list[str], comma: bool) -> bool:
    """Whether at least half of the cells that are filled are numbers, two of them or more."""
    filled = [c for c in cells if c.strip()]
    numeric = [c for c in filled if (v := number(c, comma)) is not None and math.isfinite(v)]
    return len(numeric) >= 2 and 2 * len(numeric) >= len(filled)


def _decimal_comma(rows: list[list[str]]) -> bool:
    cells = [c.strip().replace("−", "-") for row in rows for c in row]
    commas = any(re.fullmatch(r"[+-]?[\d.]*,\d+", c) for c in cells)
    points = any(re.fullmatch(r"[+-]?\d*\.\d+", c) and not THOUSANDS.fullmatch(c) for c in cells)
    return commas and not points


def _text(path: Path) -> list[tuple[int, list[str]]]:
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise FileError(f"cannot be read: {error.strerror}", file=str(path)) from error
    text = _decoded(raw)
    sample = [line for line in text.splitlines() if line.strip() and not line.strip().startswith(COMMENTS)]
    counts = {s: sum(line.count(s) > 0 for line in sample) for s in SEPARATORS}
    best = max(SEPARATORS, key=lambda s: (counts[s] > len(sample) / 2, -SEPARATORS.index(s)))
    reader = csv.reader(io.StringIO(text.replace("\r\n", "\n").replace("\r", "\n")), delimiter=best)
    try:
        return [(reader.line_num, row) for row in reader]
    except csv.Error as error:
        raise FileError(f"is no table: {error}", file=str(path), line=reader.line_num) from error


def _decoded(raw: bytes) -> str:
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return raw.decode("utf-16")
    for encoding in ("utf-8-sig", "latin-1"):
        try:
            return raw.decode(encoding)
        except UnicodeDecodeError:
            continue
    return raw.decode("latin-1")  # never fails


def _excel(path: Path, sheet: str | None) -> list[tuple[int, list[str]]]:
    try:
        from openpyxl import load_workbook
    except ModuleNotFoundError:
        raise MissingPartError(
            f"{path}: reading Excel files needs openpyxl, which is not installed: pip install 'stiffmap[excel]'"
        ) from None
    try:
        book = load_workbook(path, data_only=True, read_only=True)
    except FileNotFoundError:
        raise FileError("there is no such file", file=str(path)) from None
    except Exception as error:  # openpyxl raises many kinds for what is no workbook
        raise FileError(f"cannot be read as an Excel workbook ({error})", file=str(path)) from error
    if sheet is not None and sheet not in book.sheetnames:
        raise FileError(f"no sheet '{sheet}'; there are: {', '.join(book.sheetnames)}", file=str(path))
    page = book[sheet] if sheet else book[book.sheetnames[0]]
    return [
        (n, ["" if v is None else repr(v) if isinstance(v, float) else str(v) for v in row])
        for n, row in enumerate(page.iter_rows(values_only=True), 1)
    ]
