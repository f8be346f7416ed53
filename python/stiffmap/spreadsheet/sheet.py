"""A spreadsheet or text table as it lies in a workshop: cells as text, header found, numbers read."""

from __future__ import annotations

import csv
import io
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain, islice
from pathlib import Path
from typing import Any

from stiffmap.broadcasting import Floats
from stiffmap.cells import BETWEEN, BLOCK, Cells, filled, packed, row_numbers
from stiffmap.errors import FileError
from stiffmap.number_text import number_in
from stiffmap.spreadsheet.workbook import workbook_lines

Lines = Callable[[], Iterable[tuple[int, list[str]]]]
"""Number and cells of each line, from the first one whenever it is called."""
EXCEL = (".xlsx", ".xlsm")
NOTHING = {"", "-", "--", "–", "na", "n/a", "n.a.", "nan", "none", "null", "#n/a"}
COMMENTS = ("#", "%", "//")
LONGEST_HEADER, MOST_COLUMNS = 300, 1000
SEPARATORS = ";\t|,"
THOUSANDS = re.compile(r"[+-]?\d{1,3}(\.\d{3})+")
"""``1.000`` is a thousand in a table with decimal commas."""
COMMA = re.compile(r"^[ \t]*[+-]?[\d.]*,\d+[ \t]*$", re.M)
POINT = re.compile(r"^[ \t]*[+-]?\d*\.\d+[ \t]*$", re.M)
SAMPLE = 20_000
"""Lines by which the separator is found."""


@dataclass(frozen=True)
class Sheet:
    """Header and rows of a table; cells are text, numbers with a decimal point."""

    file: str
    header: tuple[str, ...]
    columns: tuple[Cells, ...]
    lines: Sequence[int]
    """Line of each row in the file, from 1."""
    decimal_comma: bool
    _read: dict[int, Floats] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def rows(self) -> Iterator[tuple[str, ...]]:
        """The rows, one by one."""
        return zip(*self.columns, strict=True)

    def numbers(self, column: int) -> Floats:
        """A column; NaN where nothing was read. FileError names the line of what is no number."""
        if column not in self._read:
            cells = _with_points(self.columns[column]) if self.decimal_comma else self.columns[column]
            self._read[column] = cells.numbers(lambda cell, row: self._number(cell, column, self.lines[row]))
        return self._read[column]

    def _number(self, cell: str, column: int, line: int) -> float:
        value = number(cell, False)
        if value is None:
            raise FileError(
                f"column '{self.header[column]}': expected a number; found {cell!r}",
                file=self.file,
                line=line,
            )
        return value

    def is_numeric(self, column: int) -> bool:
        """Whether all cells of a column are numbers or say that nothing was read."""
        try:
            self.numbers(column)
        except FileError:
            return False
        return True


def number(cell: str, decimal_comma: bool) -> float | None:
    """The number in a cell; NaN for nothing, None for text."""
    text = _plain(cell.strip())
    if text.lower() in NOTHING:
        return math.nan
    if decimal_comma:
        text = _with_point(text)
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
    lines = workbook_lines(path, sheet) if path.suffix.lower() in EXCEL else _text(path)
    comma = _decimal_comma(c for _, c in _kept(lines()))
    before: tuple[int, list[str]] | None = None
    rows = _kept(lines())
    for n, c in rows:
        if before is not None and _is_data(c, comma):
            first = (n, c)
            break
        before = n, c
    else:
        raise FileError("no header line with rows of numbers below it was found", file=str(path))
    assert before is not None
    header = [re.sub(r"\s+", " ", c.strip()) for c in before[1]]
    endless = next((c for c in header if len(c) > LONGEST_HEADER), None)
    if endless is not None or len(header) > MOST_COLUMNS:
        what = f"{len(header)} columns" if endless is None else f"one of {len(endless)} characters"
        raise FileError(
            f"expected a header of at most {MOST_COLUMNS} columns of {LONGEST_HEADER} characters each; found {what}",
            file=str(path),
            line=before[0],
        )
    width = max(i for i, c in enumerate(header) if c) + 1
    names = [h or f"column {i + 1}" for i, h in enumerate(header[:width])]
    twice = sorted(h for h, n in Counter(names).items() if n > 1)
    if twice:
        raise FileError(f"column '{twice[0]}' occurs twice", file=str(path), line=before[0])
    numbered = row_numbers()
    columns = packed(_even(chain([first], rows), width, numbered), width)
    return Sheet(str(path), tuple(names), columns, numbered, comma)


def _kept(lines: Iterable[tuple[int, list[str]]]) -> Iterator[tuple[int, list[str]]]:
    """Lines with something in them that are no comments."""
    return ((n, c) for n, c in lines if filled(c) and not c[0].strip().startswith(COMMENTS))


def _even(rows: Iterable[tuple[int, list[str]]], width: int, numbers: Any) -> Iterator[list[str]]:
    """Rows as long as the header; `numbers` gathers those of their lines."""
    for n, cells in rows:
        numbers.append(n)
        yield cells if len(cells) == width else [*cells, *[""] * width][:width]


def _with_points(cells: Cells) -> Cells:
    """Numbers with decimal commas and points for thousands, as numbers with a decimal point."""
    blocks = []
    for block in cells.blocks:
        text = _plain(block)
        if "." in text:
            text = BETWEEN.join(_with_point(c) for c in text.split(BETWEEN))
        blocks.append(text.replace(",", "."))
    return Cells(blocks, len(cells))


def _plain(text: str) -> str:
    return text.replace("\u00a0", "").replace("−", "-")


def _with_point(text: str) -> str:
    return text.replace(".", "").replace(",", ".") if "," in text or THOUSANDS.fullmatch(text) else text


def _is_data(cells: list[str], comma: bool) -> bool:
    """Whether at least half of the cells that are filled are numbers, two of them or more."""
    filled = [c for c in cells if c.strip()]
    numeric = [c for c in filled if (v := number(c, comma)) is not None and math.isfinite(v)]
    return len(numeric) >= 2 and 2 * len(numeric) >= len(filled)


def _decimal_comma(rows: Iterable[list[str]]) -> bool:
    """Whether numbers have commas and none has a point."""
    commas = points = False
    while block := list(islice(rows, BLOCK)):
        text = "\n".join(chain.from_iterable(block))
        if text.count("\n") != sum(map(len, block)) - 1:
            text = "\n".join(c.replace("\n", " ") for row in block for c in row)
        text = _plain(text)
        commas = commas or ("," in text and COMMA.search(text) is not None)
        points = points or (
            "." in text and any(not THOUSANDS.fullmatch(m[0].strip()) for m in POINT.finditer(text))
        )
        if points:
            return False
    return commas


def _text(path: Path) -> Lines:
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise FileError(f"cannot be read: {error.strerror}", file=str(path)) from error
    text = _decoded(raw, path).replace("\r\n", "\n").replace("\r", "\n")
    del raw
    told = (line for line in io.StringIO(text) if line.strip() and not line.strip().startswith(COMMENTS))
    sample = list(islice(told, SAMPLE))
    counts = {s: sum(s in line for line in sample) for s in SEPARATORS}
    best = max(SEPARATORS, key=lambda s: (counts[s] > len(sample) / 2, -SEPARATORS.index(s)))

    def lines() -> Iterator[tuple[int, list[str]]]:
        reader = csv.reader(io.StringIO(text), delimiter=best)
        try:
            for row in reader:
                yield reader.line_num, row
        except csv.Error as error:
            raise FileError(f"is no table: {error}", file=str(path), line=reader.line_num) from error

    return lines


def _decoded(raw: bytes, path: Path) -> str:
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        try:
            return raw.decode("utf-16")
        except UnicodeDecodeError as error:
            raise FileError(
                f"begins as UTF-16 and is none ({error.reason} at byte {error.start})", file=str(path)
            ) from error
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")  # never fails
