"""A spreadsheet or text table as it lies in a workshop: cells as text, header found, numbers read."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain, islice, takewhile, zip_longest
from pathlib import Path

import numpy as np

from stiffmap.common.errors import FileError, NoTableError
from stiffmap.common.number_text import LARGEST
from stiffmap.common.tables.cells import Cells, blocks, filled, packed
from stiffmap.common.tables.header import (
    MOST_LINES,
    Line,
    fits,
    header_of,
    record_of,
    refuse_twice,
    split_unit,
    with_labels,
    with_unit,
)
from stiffmap.common.tables.lines import (
    COMMENTS,
    Lines,
    Spelling,
    decimal_comma,
    even,
    is_data,
    is_finite,
    is_nothing,
    kept,
    lines_of,
    number,
    parted,
)
from stiffmap.common.tables.table import Table
from stiffmap.common.tables.vectors import one_number_a_cell
from stiffmap.common.tables.workbook import WORKBOOKS, sheet_names
from stiffmap.common.units import SHORT_TIMES, TIMES, unit_of

STATISTICS = re.compile(
    r"(((gesamt|grand|overall)[ -]?)?(mean|average|avg|mittel(wert)?e?|total)|mw|ø|x̄|x̅|m[aá]x\.? ?[-–] ?min|sum|summe|gesamt|std\.?( ?dev\.?)?|stdev|stabw|s|sigma|σ|m[ií]n(imum|imo|i)?|"
    r"m[aá]x(imum|imo|i)?|median|range|spannweite|rms|durchschnitt|standardabweichung|streuung|[1-6] ?(sigma|σ|s)|count|anzahl|n|uncertainty|unsicherheit|toleran(ce|z)|"
    r"varian(ce|z|za)|deviation|moyenne|somme|m[ée]diane|[ée]cart([ -]?type)?|[ée]tendue|promedio|media|mediana|suma|desviación|"
    r"desv(est)?|rango|somma|totale|deviazione|scarto|massimo|minimo|"
    r"(sampl(e|ing)|abtast)[ _-]?(rate|time|interval|zeit)|samples|block ?size|delta_x|x0|offset|sensitivity|empfindlichkeit)\.?:?( .*)?",
    re.IGNORECASE,
)
"""First cell of a row that is no reading but what a spreadsheet computed of them, or how they were sampled."""
MEAN = re.compile(
    r"(?i)(mean|average|avg|median|mittel(wert)?|mw|ø|x̄|x̅|durchschnitt|moyenne|promedio|std( ?dev)?|stdev|stabw|standardabweichung)\.?:?"
)
"""All of the last cell of such a row, where the first row is a reading."""
TIMED = re.compile(r"(?i)(time|zeit|temps|t|x[ _]value|column)([ ._]?\d+)?")
"""Names of times, or none, before each channel of a scope."""
ONE_TIME = "where it is the time of each channel, export all resampled to one"
WAY = "--header id,x,y,z,dx,dy,dz or the like (nothing between two commas for a column that is not used)"
LONGEST_HEADER, MOST_COLUMNS, MOST_ABOVE = 300, 1000, 50


@dataclass(frozen=True)
class Layout:
    """What a person says of where a table lies, and what its names may be."""

    known: Callable[[str], bool] = lambda name: False
    """Whether a name without its unit has a meaning of its own."""
    header: Sequence[str] = ()
    """Names of the columns, in place of those that the table has, or has not."""
    numbered: bool = False
    """Columns are given by their numbers: a table without a header is read."""
    table: int | None = None
    """Which of several tables on a sheet, from 1."""
    strict: bool = False
    """Whether all below the header are rows of numbers, with a cell for each column, and titles (`Table.refuse_remarks`)."""
    repeated: bool = False
    """Whether names may come again, as those of displacements do once per load case."""
    names: str = ""
    """Those that a header may have, for the message where there is none."""
    options: bool = True
    """Whether the command has --header and --table."""


PLAIN = Layout()


def read_sheet(path: Path, sheet: str | None = None, layout: Layout = PLAIN) -> Table:
    """Cells of an Excel workbook (its first sheet that holds a table, or the named one) or of a text table.

    Text: separators ; tab | , blanks and decimal points or commas are found out, UTF-8, UTF-16 and Latin-1 are read.
    Comment lines are skipped; the header is the line before the first row of mostly numbers. Raises FileError, also where
    several tables are on a sheet and `layout` does not say which.
    """
    try:
        return _read(path, sheet, layout)
    except NoTableError:
        others = [] if sheet or path.suffix.lower() not in WORKBOOKS else sheet_names(path)[1:]
        for name in others:
            with suppress(NoTableError):
                return _read(path, name, layout)
        raise


def _read(path: Path, sheet: str | None, layout: Layout) -> Table:
    page, lines, separator = lines_of(path, sheet)
    lines = one_number_a_cell(lines)
    for units in (False, True):  # cells such as 12.5 µm only where no row is plain: 100 N may head a column
        cells_only = (c for _, c in kept(lines()))
        comma = decimal_comma(
            ([parted(c)[0] for c in row] if units else row for row in cells_only), separator
        )
        spelling = Spelling(comma, units)
        rows, above, begun, found = _begun(lines, spelling, layout, str(path))
        if begun:
            break
    behind = begun[-1][1][len(_checked(found[1], str(path), found[0])) if found else 0 :] if begun else []
    named = layout.header or layout.numbered or (layout.strict and found)
    lost = found is None or any(is_finite(c, spelling) for c in behind) or not _knows(found[1][1:], layout)
    turned = _turned(kept(lines()), spelling, layout) if lost and not named else []
    if turned:
        rows, above, begun, found = _begun(lambda: turned, spelling, layout, str(path))
    first = begun[-1] if begun else None
    if first is None and not above:
        raise NoTableError(f"the {'sheet' if page else 'file'} is empty", file=str(path))
    if first is not None and (layout.header or (found is None and layout.numbered)):
        found = first[0], with_header(first[1], layout.header, str(path), first[0])
    if first is None or found is None:
        more = f"; expected its names of columns, such as {layout.names}" if layout.names else ""
        if first and layout.options:
            more += f"; if the table has none, name its columns: {WAY}, or by their numbers, as in --map x=2"
        elif not layout.names:
            more = "; a row of numbers has two or more, each alone in its cell, in half of its cells or more"
        raise NoTableError(f"no header line with rows of numbers below it was found{more}", file=str(path))
    number_, header = found
    aside = [f"row {n}, of numbers above the header" for n, _ in begun[:-1] if not layout.strict]
    titles = [*above]
    every = blocks(chain([first], kept(rows, titles)))
    opening = next(every)
    labels = _labels(opening, header, layout, spelling.comma)
    if labels:
        header, opening = with_labels(header, [cells for _, cells in labels]), opening[len(labels) :]
        aside += [f"row {n}, '{cells[0].strip()}', is no reading" for n, cells in labels if not layout.strict]
    names = _checked(header, str(path), number_)
    if not layout.repeated:
        way = " (names with blanks in them?)" if separator == " " else ""
        way += f"; name the columns: {WAY}" if layout.options else ""
        way += f"; {ONE_TIME}" if len({*names[::2]}) == 1 < len(names) - 2 else ""
        refuse_twice(names, str(path), number_, way)
    width = len(names)
    said = [*header, *(c.strip() for _, cells in above for c in cells)]
    means = MEAN.fullmatch(opening[0][1][-1].strip()) is not None
    clear = (
        _data(b, means, header, said, spelling, aside, titles, layout, str(path))
        for b in chain([opening], every)
    )
    data = even(chain.from_iterable(clear), width, str(path), separator, None if layout.strict else aside)
    cells_of, lines_ = packed(data, width)
    columns = list(cells_of)
    file = f"{path}, sheet '{page}'" if page else str(path)
    file += ", rows and columns exchanged" if turned else ""
    for i in range(width):
        names[i], columns[i] = _united(names[i], columns[i], file, lines_)
    top = tuple(said[len(header) :])
    record = record_of(above)
    found_ = Table(
        file, tuple(names), tuple(columns), lines_, number_, comma, record, top, tuple(aside), tuple(titles)
    )
    _refuse_many_times(found_)
    return found_


def _refuse_many_times(table: Table) -> None:
    """FileError where a scope wrote a time before each channel, and they differ."""
    every = range(0, len(table.names), 2)
    units = (*TIMES, *SHORT_TIMES)
    named = all(table.unit(i) in units or TIMED.fullmatch(table.names[i]) for i in every)
    if len(every) < 2 or not named or not all(map(table.is_numeric, every)):
        return
    times = [table.numbers(i) for i in every]
    if all((np.diff(t) > 0).all() for t in times):
        what = f"'{table.names[0]}' stands again, with other numbers, before each column; {ONE_TIME}"
        table.check(np.ptp(times, axis=0) == 0, lambda row: what)


def _knows(names: Sequence[str], layout: Layout) -> bool:
    """Whether a name has a unit or a meaning."""
    return any(split_unit(n)[1] or layout.known(n) for n in names)


def _turned(lines: Iterable[Line], spelling: Spelling, layout: Layout) -> list[Line]:
    """A table whose names stand to the left of their numbers, as of runs below positions, with names above numbers; nothing where
    no word there has a unit or a meaning."""
    rows = [(cells, is_data(cells, spelling)) for _, cells in lines]
    names = [cells[0].strip() for cells, data in rows if data]
    if not _knows(names, layout) or any(is_finite(n, Spelling(spelling.comma, units=True)) for n in names):
        return []
    columns = zip_longest(*(cells for cells, data in rows if data), fillvalue="")
    return [*enumerate([*(cells for cells, data in rows if not data), *map(list, columns)], 1)]


def _united(name: str, cells: Cells, file: str, lines: Sequence[int]) -> tuple[str, Cells]:
    """A column without the units of its cells, which its name has instead; the column as it is where a cell is none.
    Raises FileError for a second unit."""
    sample = next((c for c in cells if c.strip("0.,+-") and not is_nothing(c)), "")  # 0 needs no unit
    if not parted(sample)[1]:
        return name, cells
    pairs = [("", "") if is_nothing(c) else parted(c) for c in cells]
    if any(number.strip("0.,+-") and not unit for number, unit in pairs):
        return name, cells
    own = split_unit(name)[1]
    first = own or parted(sample)[1]
    for line, (_, unit) in zip(lines, pairs, strict=True):
        if unit and unit_of(unit) != unit_of(first):
            message = f"column '{name}': expected {first} in {'its cells' if own else 'all of its cells'}; found {unit}"
            raise FileError(message, file=file, line=line)
    return name if own else with_unit(name, first), Cells.of(number for number, _ in pairs)


def _checked(header: Sequence[str], file: str, line: int) -> list[str]:
    """Names of columns up to the last that has one; none is endless."""
    endless = next((c for c in header if len(c) > LONGEST_HEADER), None)
    if endless is not None or len(header) > MOST_COLUMNS:
        what = f"{len(header)} columns" if endless is None else f"one of {len(endless)} characters"
        most = f"at most {MOST_COLUMNS} columns of {LONGEST_HEADER} characters each"
        raise FileError(f"expected a header of {most}; found {what}", file=file, line=line)
    width = max(i for i, c in enumerate(header) if c) + 1
    return [h or f"column {i + 1}" for i, h in enumerate(header[:width])]


def with_header(first: Sequence[str], given: Sequence[str], file: str, line: int | None = None) -> list[str]:
    """Names of columns that a person says, or their numbers. Raises FileError for more names than columns."""
    if len(given) > len(first):
        what = f"--header: expected at most {len(first)} names, one for each column; found {len(given)}"
        raise FileError(what, file=file, line=line)
    names = [*given, *[""] * (len(first) - len(given))]
    return [n.strip() or f"column {i}" for i, n in enumerate(names, 1)]


def _begins_table(
    cells: Sequence[str], names: Sequence[str], width: int, spelling: Spelling, layout: Layout
) -> bool:
    """Whether a line within a table is the header of another one: it has a known name that is none of this one's."""
    here = [c.strip() for c in cells if c.strip()]
    known = [c for c in here if layout.known(split_unit(c)[0])]
    return (
        fits(cells, width)
        and len(known) >= 2
        and not set(known) <= set(names)
        and not any(is_finite(c, spelling) for c in cells)
    )


def _one_table(lines: Iterable[Line], spelling: Spelling, layout: Layout, file: str) -> list[Line]:
    """Lines of one of the tables of a sheet; a table begins with its header."""
    tables: list[list[Line]] = [[]]
    names: list[str] = []
    width = 0
    for n, cells in kept(lines):
        data = is_data(cells, spelling)
        if width and not data and _begins_table(cells, names, width, spelling, layout):
            tables.append([])
            names, width = [], 0
        if data:
            width = len(cells)
        else:
            names += map(str.strip, cells)
        tables[-1].append((n, cells))
    assert layout.table is not None
    if not 1 <= layout.table <= len(tables):
        what = f"--table: expected a number from 1 to {len(tables)}; found {layout.table}"
        raise FileError(what, file=file)
    return tables[layout.table - 1]


def _above(rows: Iterator[Line], spelling: Spelling, above: list[Line]) -> Iterator[Line]:
    """The rows of data; `above` gathers the last lines before the first one."""
    for n, cells in rows:
        if not filled(cells):
            continue
        data = is_data(cells, spelling)
        if data and not cells[0].strip().startswith(COMMENTS):
            yield n, cells
        elif not data:
            above.append((n, cells))
            del above[:-MOST_ABOVE]


def _begun(
    lines: Lines, spelling: Spelling, layout: Layout, file: str
) -> tuple[Iterator[Line], list[Line], list[Line], tuple[int, list[str]] | None]:
    """Lines from the second row of data on, those above the first, the first row behind rows of numbers above the header, such as
    numbers of channels, and the header. The very first row counts unless another line names the columns better."""
    for skip in (*range(1 if layout.header else MOST_LINES), 0):
        above = list[Line]()
        rows = iter(lines() if layout.table is None else _one_table(lines(), spelling, layout, file))
        data = list(islice(_above(rows, spelling, above), skip + 1))
        counted = [d for d in data[:-1] if _counts(d[1], spelling)]
        runs = bool(data) and not all(map(str.strip, data[-1][1])) and _counts(data[-1][1], spelling)
        for over in ([*above], *([sorted([*above, *counted])] if counted else ())):
            found = header_of(over, data[-1][1], layout.known, layout.repeated) if data else None
            if found and len(data) > skip and (not skip or found[0] >= data[-2][0]):
                names = _checked(found[1], file, found[0])
                behind = runs or any(is_finite(c, spelling) for c in data[-1][1][len(names) :])
                if not behind and (layout.repeated or len({*names}) == len(names)):
                    return rows, over, [d for d in data if d not in over], found
        if not skip and not runs and (found is None or any(layout.known(split_unit(n)[0]) for n in found[1])):
            break
    return rows, above, data, found


def _counts(cells: Sequence[str], spelling: Spelling) -> bool:
    """Whether the numbers of a line count runs: 1, 2, 3 below one another's names, or over arrows."""
    numbers = [number(c, spelling) for c in cells if is_finite(c, spelling)]
    return [*dict.fromkeys(numbers)] == [*range(1, len({*numbers}) + 1)]


def _all_readings(rows: Sequence[Line]) -> bool:
    """Whether rows have as many cells each, a column of plain numbers, and a first one that never says mean or sum."""
    width = len(rows[0][1])
    begins = (cells[0].strip() for _, cells in rows)
    ends = [cells[-1].strip() for _, cells in rows]
    return (
        {len(cells) for _, cells in rows} == {width}
        and not any(not word or STATISTICS.fullmatch(word) for word in begins)
        and (_plain_numbers(ends) or not any(map(MEAN.fullmatch, {*ends})))
        and any(_plain_numbers([cells[i] for _, cells in rows]) for i in reversed(range(width)))
    )


def _labels(rows: Sequence[Line], header: Sequence[str], layout: Layout, comma: bool) -> list[Line]:
    """First lines that begin with a word, where all others begin with a number: channels or sensors below the names of columns,
    of which some are known, but not the first."""
    knows = [layout.known(split_unit(h)[0]) for h in header]
    if knows[0] or not any(knows):
        return []
    begins = ["".join(cells[:1]).strip() for _, cells in rows]
    words = [*takewhile(lambda c: not (re.search(r"\d", c) or is_nothing(c)), begins)]
    numbers = [is_finite(c, Spelling(comma)) for c in begins[len(words) :]]
    return [*rows[: len(words)]] if numbers and all(numbers) else []


def _plain_numbers(cells: Sequence[str]) -> bool:
    text = "".join(cells)
    if "_" in text or not text.isascii():
        return False
    with suppress(ValueError):
        return all(abs(float(c)) <= LARGEST for c in cells)
    return False


def _data(
    rows: Sequence[Line],
    means: bool,
    header: Sequence[str],
    names: Sequence[str],
    spelling: Spelling,
    aside: list[str],
    titles: list[Line],
    layout: Layout,
    file: str,
) -> Iterator[Line]:
    """Rows of readings: without rows of means, of which `aside` says so, and without headers that are repeated and remarks, in `titles`.

    `names`: all that stands above the rows; `means`: whether the first one ends with a word for a mean.
    """
    if _all_readings(rows):
        yield from rows
        return
    begins = [is_finite(cells[0], spelling) for _, cells in rows[:MOST_ABOVE] if is_data(cells, spelling)]
    counted = 2 * sum(begins) > len(begins)
    for n, cells in rows:
        first = next(c.strip() for c in cells if c.strip())
        last = cells[-1].strip()
        words = counted and number(first, spelling) is None and not is_data(cells, spelling)
        if STATISTICS.fullmatch(first) and number(first, spelling) is None:
            aside.append(f"row {n}, '{first}', is no reading")
        elif MEAN.fullmatch(last) and not means and len(cells) == len(header):
            aside.append(f"row {n}, '{last}', is no reading")
        elif words or not any(is_finite(c, spelling) for c in cells):
            if _begins_table(cells, names, len(header), spelling, layout):
                way = ": say --table 1 for the one above, --table 2 for this one" if layout.options else ""
                what = f"another table begins here{way}"
                raise FileError(what, file=file, line=n)
            titles.append((n, cells))
        else:
            yield n, cells
