"""data.csv as a table: its first line is the header."""

from __future__ import annotations

import os
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from stiffmap.common.errors import FileError
from stiffmap.common.tables.cells import filled, packed
from stiffmap.common.tables.header import refuse_twice
from stiffmap.common.tables.lines import decimal_comma, even, lines_of
from stiffmap.common.tables.table import Table


def read_table(path: Path, expected: int | None = None) -> Table:
    """Cells of a text or workbook with a header line and, where it is known, an expected number of rows; raises `FileError`."""
    _, read_lines, separator = lines_of(path)

    def rows() -> Iterator[tuple[int, list[str]]]:
        return ((n, cells) for n, cells in read_lines() if filled(cells))

    data = rows()
    header = tuple(c.strip() for c in next(data, (1, []))[1])
    if not header:
        raise FileError("the file is empty", file=str(path))
    refuse_twice(header, str(path), 1)
    columns, lines = packed(even(data, len(header), str(path), separator), len(header))
    cells = (c for _, c in islice(rows(), 1, None))
    comma = separator not in ("", ",") and decimal_comma(cells, separator)
    if not lines:
        raise FileError("expected a header line and at least one row", file=str(path))
    if expected is not None:
        _whole(path, expected, len(lines))
    return Table(str(path), header, columns, lines, 1, comma)


def _whole(path: Path, expected: int, found: int) -> None:
    """FileError for a table that was cut off."""
    with path.open("rb") as stream:
        stream.seek(-1, os.SEEK_END)
        ended = stream.read(1) in b"\r\n"
    if found != expected or not ended:
        what = f"found {found}" if found != expected else "found no end of the last line"
        raise FileError(
            f"expected {expected} rows, as 'rows' in the experiment's YAML file says; {what}: the table was cut off, "
            "or changed by hand (then correct or delete 'rows')",
            file=str(path),
        )
