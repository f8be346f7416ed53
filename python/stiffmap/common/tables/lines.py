"""Lines of a table, from a text or a workbook: separators, decimal signs and encodings are found out."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from itertools import chain, islice
from pathlib import Path
from typing import NamedTuple

from stiffmap.common.arithmetic import sum_of_numbers
from stiffmap.common.errors import FileError
from stiffmap.common.number_text import number_in
from stiffmap.common.tables.cells import BETWEEN, Cells, blocks, filled
from stiffmap.common.tables.workbook import WORKBOOKS, workbook_lines
from stiffmap.common.texts import text_of
from stiffmap.common.units import unit_of

Lines = Callable[[], Iterable[tuple[int, list[str]]]]
"""Number and cells of each line, from the first one whenever it is called."""
COMMENTS = ("#", "%", "//")
SEPARATORS = ";\t|,& "
BLANKS = re.compile(r"[ \t]+(?![\[(])")
"""Between cells, but not before a unit in brackets."""
HARD = "\u00a0"
"""A blank at which no line is cut."""
QUOTED_WORD = re.compile(r'(?<!\S)"([^"]*)"(?!\S)')
"""A cell between blanks that may have blanks of its own."""
MARKED = re.compile(r"^(#|%|//)\s+")
"""The mark of a comment, which is no cell."""
THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(\.\d{3})+")
"""``1.000`` is a thousand in a table with decimal commas; ``0.041`` is not."""
COMMA = re.compile(r"^[ \t]*[+-]?[\d.]*,\d+(?:[eEdD][+-]?\d+)?[ \t]*$", re.M)
DIGIT = re.compile(r"\s*[-+−–]?[.,]?\d")
QUOTED = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")
POINT = re.compile(rf"^[ \t]*(?!{THOUSANDS.pattern}[ \t]*$)[+-]?[\d,]*\.\d+(?:[eEdD][+-]?\d+)?[ \t]*$", re.M)
"""A number with a decimal point, which no `THOUSANDS` are."""
ODD_SIGNS = str.maketrans("−–", "--", "\u00a0\u2007\u2009\u202f")
"""Blanks within a number go, and a minus is that of a keyboard."""
SAMPLE = 2_000
"""Lines by which the separator is found."""
NUMBER = re.compile(r"\s*[+-]?(\d+[.,]?\d*|[.,]\d+)([eEdD][+-]?\d+)?\s*")
GROUPED = re.compile(r"[+-]?\d{1,3}(?:(['’ ])\d{3}(?:\1\d{3})*(?:\.\d+)?|(?:,\d{3})+\.\d+)")
"""``1'000``, ``1 000.5``, ``1,000.5``."""
_PART = r"(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?"
COMPLEX = re.compile(rf"\(?([+-]?{_PART})([+-])(?:[ij]({_PART})|({_PART})[ij])\)?", re.IGNORECASE)
IN_PI = re.compile(r"(?i)°|π|pi(?!\w)")
SIGNS = tuple(
    (re.compile(pattern), sign)
    for pattern, sign in (
        (r"^\+ *", ""),
        (r"[·×]", "*"),
        (r"°", f"({math.radians(1.0)!r})"),
        (r"(?i)(?:(?:np|math)\.)?(?:π|pi(?!\w))", f"({math.pi!r})"),
        (r"(?<=[\d.)]) *(?=\()", "*"),
    )
)
"""Of sums and products, as Python writes them."""
LONGEST_SUM = 80
LABVIEW = "LabVIEW Measurement"
LATEX = re.compile(r"(?m)^ *\\(?:hline|\w+rule)\b|\\\\(?:\[.*?\])? *(?:\\\w+)? *$|^.*\\(?:begin|end)\{.*$")
"""Rules before a row or behind it, and the strokes at its end."""
FORTRAN = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)[dD][+-]?\d+")
WITH_UNIT = re.compile(
    r"([+\-−–]?\d(?:[\d.,]|['’ ](?=\d))*(?:[eE][+-]?\d+)?)\s*((?:[^\W\d_]|[°\"']).{0,19})", re.DOTALL
)
"""``12.5 µm``; what a wrong separator leaves together has no letter behind its first number, or is longer than any unit."""

NOTHING = {
    "", *["na", "n/a", "n.a.", "nan", "none", "null", "#n/a", "#nv", "n.m.", "k.a.", "ka", "?", "x", "./.", "*", "out", "off", "leer", "empty", "fehlt", "missing", "entfällt", "ausreißer"],
    *["#div/0!", "#value!", "#wert!", "#ref!", "#bezug!", "#name?", "#num!", "#zahl!"], "k. a.", "nicht gemessen", "not read", "not measured",
    *["ol", "o.l.", "over", "+over", "-over", "overload", "overrange", "over range", "overflow", "err", "error", "fail", "failed", "invalid", "no signal", "timeout"],
    *["#####", "1.#qnan", "-1.#ind", "1.#ind"],
}  # fmt: skip
DASHES = re.compile(r"[-–—_.· ]+")
UNNAMED = "; where the first counts or names the rows, write row ahead of the header"


class Spelling(NamedTuple):
    """How a table writes numbers."""

    comma: bool = False
    """With decimal commas."""
    units: bool = False
    """A unit may follow in the cell, as in ``12.5 µm``."""


def lines_of(path: Path, sheet: str | None = None) -> tuple[str, Lines, str]:
    """A workbook's first or named sheet: its name, its lines, nothing. A text: nothing, its lines, what separates its cells.

    Text: cells are separated by ; tab | , or blanks; UTF-8, UTF-16 and Latin-1 are read. Raises FileError.
    """
    if path.suffix.lower() in WORKBOOKS:
        return *workbook_lines(path, sheet), ""
    if sheet:
        raise FileError(f"no sheet '{sheet}': a text has none", file=str(path))
    return _text(path)


def kept(
    lines: Iterable[tuple[int, list[str]]], titles: list[tuple[int, list[str]]] | None = None
) -> Iterator[tuple[int, list[str]]]:
    """Lines with something in them that are no comments; `titles` gathers comments with a word in them."""
    for block in blocks(lines):
        begins = {c[0].lstrip()[:1] if c else "" for _, c in block}
        if begins.isdisjoint(("", *(mark[0] for mark in COMMENTS))):
            yield from block
            continue
        for n, cells in block:
            if filled(cells) and not cells[0].lstrip().startswith(COMMENTS):
                yield n, cells
            elif titles is not None and re.search(r"[^\W_]", " ".join(cells)):
                titles.append((n, cells))


def even(
    rows: Iterable[tuple[int, list[str]]],
    width: int,
    file: str,
    separator: str,
    aside: list[str] | None = None,
) -> Iterator[tuple[int, list[str]]]:
    """Rows with as many cells as there are columns; FileError for a row of a text with fewer, or with more that are not empty.

    With `aside` a row may be short, unless blanks leave open which cell it lacks, and words behind the last column are said there.
    """
    behind: list[str] = []
    for block in blocks(rows):  # what is said of several rows comes first
        if {len(cells) for _, cells in block} == {width}:
            yield from block
            continue
        for n, cells in block:
            if len(cells) != width:
                more = [c.strip() for c in cells[width:] if c.strip()]
                found = max((i for i, c in enumerate(cells, 1) if i == width or c.strip()), default=0)
                found = found if len(cells) > width else len(cells)
                unclear = NUMBER.fullmatch(more[0]) if more else separator == " "
                if separator and found != width and (unclear or aside is None):
                    what = f"expected {width} values, found {found}{UNNAMED * (found == width + 1)}"
                    raise FileError(what, file=file, line=n)
                behind += [f"row {n}, '{' '.join(more)[:40]}' behind the last column"] if more else []
                cells = [*cells, *[""] * width][:width]
            yield n, cells
    if behind and aside is not None:
        aside.append(behind[0] + (f", and {len(behind) - 1} rows like it" if len(behind) > 1 else ""))


def plain(text: str) -> str:
    return text if text.isascii() else text.translate(ODD_SIGNS)


def with_point(text: str) -> str:
    return text.replace(".", "").replace(",", ".") if "," in text or THOUSANDS.fullmatch(text) else text


def with_points(cells: Cells) -> Cells:
    """Numbers with decimal commas and points for thousands, as numbers with a decimal point."""
    blocks = []
    for block in cells.blocks:
        text = plain(block)
        if "." in text:
            text = BETWEEN.join(with_point(c) for c in text.split(BETWEEN))
        blocks.append(text.replace(",", "."))
    return Cells(blocks, len(cells))


def decimal_comma(rows: Iterable[list[str]], separator: str) -> bool:
    """Whether numbers have commas and none has a point; where cells stand between commas, ``"1,500"`` does not tell."""
    commas = False
    for k, block in enumerate(blocks(rows)):
        # the number of a version or a rate, alone above the table, does not tell
        block = block if k else [r for r in block if sum(map(bool, map(DIGIT.match, r))) > 1] or block
        text = "\n".join(chain.from_iterable(block))
        if text.count("\n") != sum(map(len, block)) - 1:
            text = "\n".join(c.replace("\n", " ") for row in block for c in row)
        text = plain(text)
        commas = commas or (
            "," in text
            and any(separator != "," or not QUOTED.fullmatch(m[0].strip()) for m in COMMA.finditer(text))
        )
        if POINT.search(text):
            return False
    return commas


def parted(cell: str) -> tuple[str, str]:
    """A number and the unit that stands next to it in a cell; a cell without a unit is left as it is."""
    match = WITH_UNIT.fullmatch(cell.strip())
    return (match[1].strip(), match[2].strip()) if match and unit_of(match[2]) else (cell, "")


def number(cell: str, spelling: Spelling) -> float | None:
    """The number in a cell; NaN for nothing, None for text."""
    text = plain(cell.strip())
    if spelling.units:
        text = parted(text)[0]
    if is_nothing(text):
        return math.nan
    if spelling.comma:
        text = with_point(text)
    if GROUPED.fullmatch(text):
        text = re.sub(r"[^\d.+-]", "", text)
    elif FORTRAN.fullmatch(text):
        text = re.sub("[dD]", "e", text)
    try:
        value = number_in(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def is_nothing(text: str) -> bool:
    """Whether a cell says that nothing was read."""
    return text.lower() in NOTHING or DASHES.fullmatch(text) is not None


def complex_number(cell: str) -> complex | None:
    """``0.1+0.2i``, ``(0.1-0.2j)`` or ``0.1 + j0.2``; None for what is none."""
    match = COMPLEX.fullmatch(re.sub(r"[\s*]", "", cell).replace(",", "."))
    return None if match is None else complex(float(match[1]), float(match[2] + (match[3] or match[4])))


def sum_in(cell: str, comma: bool = False) -> float | None:
    """The value of sums and products with numbers, π and degrees (in rad): ``0.33 + 0.42``, ``2*0.15``, ``-π/2``, ``90°``.

    None for anything else: ``0 - 1`` may be a range, ``1/2`` a date.
    """
    if len(cell) > LONGEST_SUM:
        return None
    text = plain(cell.strip())
    if comma or "°" in text:
        text = text.replace(",", ".")
    for pattern, sign in SIGNS:
        text = pattern.sub(sign, text)
    summed = re.fullmatch(r"[-+*/().\de ]*[+*(][-+*/().\de ]*", text)
    if not summed or re.search(r"[\d.)] *-", text):
        return None
    with suppress(SyntaxError, TypeError, ArithmeticError):
        value = sum_of_numbers(text)
        return value if math.isfinite(value) else None
    return None


def radians(cell: str, comma: bool = False) -> float | None:
    """The angle in a cell such as ``-π/2`` or ``90°``, whatever its column's unit; None for what is none of them."""
    return sum_in(cell, comma) if IN_PI.search(cell) else None


def is_finite(cell: str, spelling: Spelling) -> bool:
    """Whether a cell holds a number."""
    value = number(cell, spelling)
    if value is None:
        return complex_number(cell) is not None or (not re.search("[°(]", cell) and sum_in(cell) is not None)
    return math.isfinite(value)


def is_data(cells: list[str], spelling: Spelling) -> bool:
    """Whether at least half of the cells that are filled are numbers, two of them or more."""
    numeric = sum(is_finite(c, spelling) for c in cells)
    return numeric >= 2 and 2 * numeric >= sum(bool(c.strip()) for c in cells)


def _text(path: Path) -> tuple[str, Lines, str]:
    text = text_of(path)
    binary = "\0" in text[:SAMPLE]
    if binary or re.match(r"\s*[\[{]\s*[\[{\"]", text):
        found = "a binary file" if binary else "JSON"
        what = f"expected rows of text, or a workbook ({', '.join(WORKBOOKS)}), found {found}: save the table as CSV"
        raise FileError(what, file=str(path))
    text = LATEX.sub("", text) if "\\begin{" in text else text
    text = _below_headers(text) if text.startswith(LABVIEW) else text
    lines_ = (line for line in io.StringIO(text) if line.strip() and not line.strip().startswith(COMMENTS))
    sample = list(islice(lines_, SAMPLE))
    well = {s: _numbers_between(s, sample) for s in SEPARATORS}
    best = max(SEPARATORS, key=lambda s: well[s][:2])  # the first of equals
    if best == " " and 2 * well["\t"][2] > well[" "][2]:  # blanks within cells, as in SMR 1
        best = "\t"

    def lines() -> Iterator[tuple[int, list[str]]]:
        if best == " ":
            yield from ((n, _cut(line)) for n, line in enumerate(io.StringIO(text), 1))
            return
        reader = csv.reader(io.StringIO(text), delimiter=best)
        try:
            for row in reader:
                yield reader.line_num, row
        except csv.Error as error:
            raise FileError(f"is no table: {error}", file=str(path), line=reader.line_num) from error

    # R's row names stand in quotes below a header that has no name for them
    quoted = len(sample) > 1 and all(line.startswith('"') for line in sample)
    (top, names), *rows = [*islice(kept(lines()), SAMPLE if quoted else 0)] or [(0, [])]
    if rows and all(len(cells) == len(names) + 1 and all(map(str.strip, cells)) for _, cells in rows):
        return "", lambda: ((n, ["row", *cells] if n == top else cells) for n, cells in lines()), best
    return "", lines, best


def _below_headers(text: str) -> str:
    """A file of LabVIEW with blank lines for its headers, but for the units, and a name that says what the first column is."""
    head, _, rows = text.rpartition("***End_of_Header***")
    first = "Frequency [Hz]" if re.search(r"(?m)^X_Dimension\s+Frequency", head) else "Time [s]"
    units = (line if line.startswith("Y_Unit_Label") else "" for line in head.split("\n"))
    rows = re.sub(r"[\t,;]Comment\s*?$", "", rows, count=1, flags=re.MULTILINE)  # of a cell that no row has
    return "\n".join(units) + rows.replace("X_Value", first, 1)


def _numbers_between(separator: str, lines: Sequence[str]) -> tuple[int, int, int]:
    """How well it parts the cells: quotations and brackets that it breaks, negative, numbers in rows of them, and those rows."""
    with suppress(csv.Error):  # the reader of the whole says where
        rows = map(_cut, lines) if separator == " " else csv.reader(lines, delimiter=separator)
        each = [[c for c in row if c.strip()] for row in rows]
        cells = list(chain.from_iterable(each))
        counts = [sum(NUMBER.fullmatch(c) is not None or parted(c)[1] != "" for c in row) for row in each]
        counts = [n for n, row in zip(counts, each, strict=True) if n and 2 * n >= len(row)]
        broken = sum(
            '"' in c or c == "|" or any(c.count(a) != c.count(b) for a, b in ("[]", "{}")) for c in cells
        )
        return -broken, sum(counts), len(counts)
    return -len(lines), 0, 0


def _cut(line: str) -> list[str]:
    if len(line) > csv.field_size_limit():
        raise csv.Error("field larger than field limit")
    if '"' not in line:
        return BLANKS.split(MARKED.sub(r"\1", line.strip()))
    whole = QUOTED_WORD.sub(lambda m: (m[1] or "NA").replace(" ", HARD), line)
    return [c.replace(HARD, " ") for c in BLANKS.split(MARKED.sub(r"\1", whole.strip()))]
