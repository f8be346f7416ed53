"""data.csv to columns; every problem names file, row and column."""

from __future__ import annotations

import csv
import math
import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from stiffmap.errors import FileError
from stiffmap.files.schema.base import suggestion
from stiffmap.number_text import number_in
from stiffmap.outputs import unguarded

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Table:
    """Text cells of a CSV file; row 1 is the header."""

    file: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]

    def __contains__(self, column: str) -> bool:
        return column in self.header

    def text(self, column: str) -> list[str]:
        """Cells of a column; raises `FileError` where there is none."""
        if column not in self.header:
            near = suggestion(column, list(self.header))
            raise FileError(
                f"missing column '{column}'{near}; found {', '.join(self.header)}", file=self.file
            )
        i = self.header.index(column)
        return [unguarded(row[i].strip()) for row in self.rows]

    def numbers(self, column: str, *, blank: bool = False) -> Floats:
        """A column as floats; with `blank`, empty cells are NaN (a value that was not read)."""
        cells = self.text(column)
        return np.array([self._number(c, column, n, blank) for c, n in zip(cells, self.lines, strict=True)])

    def _number(self, cell: str, column: str, line: int, blank: bool) -> float:
        if blank and cell.lower() in ("", "nan", "na"):
            return math.nan
        try:
            value = number_in(cell)
        except ValueError:
            found = "an empty cell" if not cell else repr(cell)
            raise FileError(
                f"column '{column}': expected a number; found {found}", file=self.file, line=line
            ) from None
        if not math.isfinite(value):
            raise FileError(
                f"column '{column}': expected a finite number; found {cell}", file=self.file, line=line
            )
        return value


def read_table(path: Path, expected: int | None = None) -> Table:
    """Cells of a CSV file with a header line and, where it is known, an expected number of rows; raises `FileError`."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            reader = csv.reader(stream)
            numbered = [(reader.line_num, row) for row in reader if any(c.strip() for c in row)]
    except OSError as error:
        raise FileError(f"cannot be read: {error.strerror}", file=str(path)) from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise FileError(f"not a CSV file in UTF-8 ({error})", file=str(path)) from error
    if len(numbered) < 2:
        raise FileError("expected a header line and at least one row", file=str(path))
    header = tuple(c.strip() for c in numbered[0][1])
    _check(header, numbered[1:], str(path))
    if expected is not None:
        _whole(path, expected, len(numbered) - 1)
    return Table(
        str(path), header, tuple(tuple(row) for _, row in numbered[1:]), tuple(n for n, _ in numbered[1:])
    )


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


def _check(header: Sequence[str], rows: Sequence[tuple[int, list[str]]], file: str) -> None:
    twice = sorted(c for c, times in Counter(header).items() if times > 1)
    if twice:
        raise FileError(f"column '{twice[0]}' occurs twice", file=file, line=1)
    for line, row in rows:
        if len(row) != len(header):
            raise FileError(f"expected {len(header)} cells; found {len(row)}", file=file, line=line)
