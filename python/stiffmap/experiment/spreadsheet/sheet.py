"""A spreadsheet or text table as it lies in a workshop: cells as text, header found, numbers read."""

from __future__ import annotations

import csv
import io
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import chain, islice
from pathlib import Path
from typing import Any

from stiffmap.common.broadcasting import Floats
from stiffmap.common.cells import BETWEEN, BLOCK, Cells, filled, packed, row_numbers
from stiffmap.common.errors import FileError
from stiffmap.common.number_text import number_in
from stiffmap.common.workbook import workbook_lines
from stiffmap.experiment.spreadsheet.header import header_of, record_of

Lines = Callable[[], Iterable[tuple[int, list[str]]]]
"""Number and cells of each line, from the first one whenever it is called."""
EXCEL = (".xlsx", ".xlsm")
NOTHING = {
    *(
        "",
        "na",
        "n/a",
        "n.a.",
        "nan",
        "none",
        "null",
        "#n/a",
        "#nv",
        "n.m.",
        "k.a.",
        "k. a.",
        "ka",
        "?",
        "x",
        "./.",
        "*",
    ),
    *(
        "#div/0!",
        "#value!",
        "#wert!",
        "#ref!",
        "#bezug!",
        "#name?",
        "#num!",
        "#zahl!",
        "fehlt",
        "missing",
        "entfällt",
    ),
    *("out", "off", "ausreißer", "leer", "empty", "nicht gemessen", "not read", "not measured"),
}
DASHES = re.compile(r"[-–—_.· ]+")
STATISTICS = re.compile(
    r"(mean|average|avg|mittel(wert)?e?|mw|ø|sum|summe|total|gesamt|std\.?( ?dev\.?)?|stdev|stabw|s|sigma|σ|min(imum)?|"
    r"max(imum)?|median|range|spannweite|rms|durchschnitt|standardabweichung|streuung)\.?:?( .*)?",
    re.IGNORECASE,
)
"""First cell of a row that is no reading but what a spreadsheet computed of them."""
COMMENTS = ("#", "%", "//")
LONGEST_HEADER, MOST_COLUMNS = 300, 1000
SEPARATORS = ";\t|,"
THOUSANDS = re.compile(r"[+-]?\d{1,3}(\.\d{3})+")
"""``1.000`` is a thousand in a table with decimal commas."""
COMMA = re.compile(r"^[ \t]*[+-]?[\d.]*,\d+[ \t]*$", re.M)
POINT = re.compile(r"^[ \t]*[+-]?\d*\.\d+[ \t]*$", re.M)
SAMPLE = 2_000
"""Lines by which the separator is found."""
NUMBER = re.compile(r"\s*[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?\s*")


@dataclass(frozen=True)
class Sheet:
    """Header and rows of a table; cells are text, numbers with a decimal point."""

    file: str
    header: tuple[str, ...]
    columns: tuple[Cells, ...]
    lines: Sequence[int]
    """Line of each row in the file, from 1."""
    decimal_comma: bool
    record: tuple[tuple[str, str], ...] = ()
    """Operator, instrument and the like, from the lines above the table."""
    aside: tuple[str, ...] = ()
    """What was left out: rows of means, remarks below the table."""
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
                f"column '{self.header[column]}': expected a number; found {cell!r} "
                f"(cell {column_letter(column)}{line})",
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
    if text.lower() in NOTHING or DASHES.fullmatch(text):
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
    page = ""
    if path.suffix.lower() in EXCEL:
        page, lines = workbook_lines(path, sheet)
    else:
        lines = _text(path)
    comma = _decimal_comma(c for _, c in _kept(lines()))
    above: list[tuple[int, list[str]]] = []
    rows = iter(lines())
    first = next((row for row in _above(rows, comma, above)), None)
    found = None if first is None else header_of(above, first[1])
    if first is None or found is None:
        raise FileError("no header line with rows of numbers below it was found", file=str(path))
    number_, header = found
    endless = next((c for c in header if len(c) > LONGEST_HEADER), None)
    if endless is not None or len(header) > MOST_COLUMNS:
        what = f"{len(header)} columns" if endless is None else f"one of {len(endless)} characters"
        raise FileError(
            f"expected a header of at most {MOST_COLUMNS} columns of {LONGEST_HEADER} characters each; found {what}",
            file=str(path),
            line=number_,
        )
    width = max(i for i, c in enumerate(header) if c) + 1
    names = [h or f"column {i + 1}" for i, h in enumerate(header[:width])]
    twice = sorted(h for h, n in Counter(names).items() if n > 1)
    if twice:
        raise FileError(f"column '{twice[0]}' occurs twice", file=str(path), line=number_)
    numbered, aside = row_numbers(), list[str]()
    data = _data(chain([first], _kept(rows)), header, comma, aside)
    columns = packed(_even(data, width, numbered), width)
    file = f"{path}, sheet '{page}'" if page else str(path)
    return Sheet(file, tuple(names), columns, numbered, comma, record_of(above), tuple(aside))


def _kept(lines: Iterable[tuple[int, list[str]]]) -> Iterator[tuple[int, list[str]]]:
    """Lines with something in them that are no comments."""
    return ((n, c) for n, c in lines if filled(c) and not c[0].strip().startswith(COMMENTS))


def _above(
    rows: Iterator[tuple[int, list[str]]], comma: bool, above: list[tuple[int, list[str]]]
) -> Iterator[tuple[int, list[str]]]:
    """The rows of data; `above` gathers the last lines before the first one."""
    for n, cells in rows:
        if not filled(cells):
            continue
        data = _is_data(cells, comma)
        if data and not cells[0].strip().startswith(COMMENTS):
            yield n, cells
        elif not data:
            above.append((n, cells))
            del above[:-8]


def _data(
    rows: Iterable[tuple[int, list[str]]], header: Sequence[str], comma: bool, aside: list[str]
) -> Iterator[tuple[int, list[str]]]:
    """Rows of readings: without rows of means, headers that are repeated and remarks, of which `aside` says so."""
    for n, cells in rows:
        first = next(c.strip() for c in cells if c.strip())
        if STATISTICS.fullmatch(first) and number(first, comma) is None:
            aside.append(f"row {n}, '{first}', is no reading")
        elif not any(_finite(c, comma) for c in cells):
            again = [c.strip() for c in cells[:2]] == list(header[:2])
            aside.append(f"row {n} {'repeats the header' if again else f'is a remark: {first[:40]}'}")
        else:
            yield n, cells


def _finite(cell: str, comma: bool) -> bool:
    value = number(cell, comma)
    return value is not None and math.isfinite(value)


def column_letter(index: int) -> str:
    """``A`` for 0, ``AB`` for 27, as spreadsheets name columns."""
    name = ""
    index += 1
    while index:
        index, rest = divmod(index - 1, 26)
        name = chr(65 + rest) + name
    return name


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
    lines_ = (line for line in io.StringIO(text) if line.strip() and not line.strip().startswith(COMMENTS))
    sample = list(islice(lines_, SAMPLE))
    best = max(SEPARATORS, key=lambda s: _numbers_between(s, sample))  # the first of equals

    def lines() -> Iterator[tuple[int, list[str]]]:
        reader = csv.reader(io.StringIO(text), delimiter=best)
        try:
            for row in reader:
                yield reader.line_num, row
        except csv.Error as error:
            raise FileError(f"is no table: {error}", file=str(path), line=reader.line_num) from error

    return lines


def _numbers_between(separator: str, lines: Sequence[str]) -> tuple[int, int]:
    """How well it parts the cells: quotations that it breaks, negative, and cells that are numbers then."""
    with suppress(csv.Error):  # the reader of the whole says where
        cells = list(chain.from_iterable(csv.reader(lines, delimiter=separator)))
        return -sum('"' in c for c in cells), sum(NUMBER.fullmatch(c) is not None for c in cells)
    return -len(lines), 0


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
