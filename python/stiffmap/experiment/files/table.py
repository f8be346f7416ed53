"""data.csv to columns; every problem names file, row and column."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError, MissingColumnError, suggestion
from stiffmap.common.outputs import unguarded
from stiffmap.common.tables.cells import Cells, filled, numbered, packed, row_numbers
from stiffmap.common.tables.header import refuse_twice
from stiffmap.common.tables.lines import decimal_comma, even, finite_number, lines_of, with_points


@dataclass(frozen=True)
class Table:
    """Text cells of a CSV file; row 1 is the header."""

    file: str
    header: tuple[str, ...]
    columns: tuple[Cells, ...]
    lines: Sequence[int]
    sizes: Mapping[str, float] = field(default_factory=dict)
    """SI size of a column's unit, by which its numbers are multiplied."""

    def __len__(self) -> int:
        return len(self.lines)

    def __contains__(self, column: str) -> bool:
        return column in self.header

    def text(self, column: str) -> list[str]:
        """Cells of a column; raises `FileError` where there is none."""
        return [unguarded(cell) for cell in self._cells(column)]

    def _cells(self, column: str) -> Cells:
        if column not in self.header:
            near = suggestion(column, self.header)
            raise MissingColumnError(
                f"missing column '{column}'{near}; found {', '.join(self.header)}", file=self.file
            )
        return self.columns[self.header.index(column)]

    def numbers(self, column: str, *, blank: bool = False) -> Floats:
        """A column in SI; with `blank`, empty cells are NaN (a value that was not read)."""
        found = self._cells(column).numbers(lambda cell, row: self._number(cell, column, row, blank))
        return found * self.sizes[column] if self.sizes.get(column, 1.0) != 1.0 else found

    def _number(self, cell: str, column: str, row: int, blank: bool) -> float:
        try:
            return finite_number(cell, ("", "nan", "na") if blank else ())
        except ValueError as problem:
            expected, found = problem.args
            self.fail(f"column '{column}': expected {expected}; found {found}", row)

    def block(self, names: Sequence[str], *, blank: bool, missing: float | None = np.nan) -> Floats:
        """(n, names) numbers; a column that is not there is `missing`, or refused where that is None."""
        n = len(self)
        there = [c in self or missing is None for c in names]
        columns = [
            self.numbers(c, blank=blank) if t else np.full(n, missing)
            for c, t in zip(names, there, strict=True)
        ]
        return np.column_stack(columns)

    def one_of(self, names: Iterable[str]) -> str | None:
        """The first of these columns that the table has."""
        return next((c for c in names if c in self), None)

    def refuse_unknown(self, known: Sequence[str], list_of: str) -> None:
        """`FileError` for the first column that is none of these; `list_of` stands before their names."""
        for column in self.header:
            if column not in known:
                near = suggestion(column, known)
                self.fail(f"unknown column '{column}'{near}; {list_of} {', '.join(known)}")

    def fail(self, message: str, row: int | None = None) -> NoReturn:
        """Raise `FileError` that names a row, or the header."""
        raise FileError(message, file=self.file, line=1 if row is None else self.lines[row])

    def check(self, good: Any, message: Callable[[int], str]) -> None:
        """`FileError` at the first row where a condition (n,) does not hold."""
        wrong = np.flatnonzero(~np.asarray(good, dtype=bool))
        if wrong.size:
            self.fail(message(int(wrong[0])), int(wrong[0]))


def read_table(path: Path, expected: int | None = None) -> Table:
    """Cells of a text or workbook with a header line and, where it is known, an expected number of rows; raises `FileError`."""
    source, lines = lines_of(path), row_numbers()

    def rows() -> Iterator[tuple[int, list[str]]]:
        return ((n, cells) for n, cells in source.lines() if filled(cells))

    below = rows()
    header = tuple(c.strip() for c in next(below, (1, []))[1])
    if not header:
        raise FileError("the file is empty", file=str(path))
    refuse_twice(header, str(path), 1)
    below = even(below, len(header), str(path), source.separator)
    columns = packed(numbered(below, lines), len(header))
    if source.separator not in ("", ",") and decimal_comma(
        (c for _, c in islice(rows(), 1, None)), source.separator
    ):
        columns = tuple(map(with_points, columns))
    if not lines:
        raise FileError("expected a header line and at least one row", file=str(path))
    if expected is not None:
        _whole(path, expected, len(lines))
    return Table(str(path), header, columns, lines)


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
