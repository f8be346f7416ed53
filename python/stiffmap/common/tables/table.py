"""A table: its header, its cells as text, and their numbers, a column at a time; every problem names file, row and column."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NoReturn, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError, MissingColumnError, suggestion
from stiffmap.common.number_text import number_in
from stiffmap.common.outputs import unguarded
from stiffmap.common.short import first_of
from stiffmap.common.tables.cells import Cells
from stiffmap.common.tables.header import split_unit
from stiffmap.common.tables.lines import COMMENTS, Spelling, number, with_points

T = TypeVar("T")


@dataclass(frozen=True)
class Table:
    """Header and rows of a text or a workbook; cells are text."""

    file: str
    header: tuple[str, ...]
    columns: tuple[Cells, ...]
    lines: Sequence[int]
    """Line of each row in the file, from 1."""
    top: int = 0
    """Line of the names, from 1; 0: in no file."""
    decimal_comma: bool = False
    record: tuple[tuple[str, str], ...] = ()
    """Operator, instrument and the like, from the lines above the table."""
    above: tuple[str, ...] = ()
    """Cells of the lines down to the header."""
    aside: tuple[str, ...] = ()
    """What was left out: rows of means, cells behind the last column."""
    titles: tuple[tuple[int, Sequence[str]], ...] = ()
    """Lines of words above the rows and between them, by their numbers."""
    sizes: Mapping[str, float] = field(default_factory=dict)
    """SI size of a column's unit, by which `si` multiplies its numbers."""
    _read: dict[int, Floats] = field(default_factory=dict, init=False, repr=False, compare=False)

    def __len__(self) -> int:
        return len(self.lines)

    def __contains__(self, column: str) -> bool:
        return column in self.header

    @property
    def left_out(self) -> tuple[str, ...]:
        """What is in none of the columns, in words."""
        again, first = self.headers_again, self.lines[0] if self.lines else 0
        remarks = {n: " ".join(filter(None, map(str.strip, cells))) for n, cells in self.titles if n > first}
        said = [f"row {n} is a remark: {remarks[n][:40]}" for n in sorted(remarks.keys() - {*again})]
        if again:
            rows = f"row{'s' * (len(again) > 1)} {first_of([*map(str, again)], 3)}"
            said.append(f"{rows} repeat{'s' * (len(again) == 1)} the header")
        return (*self.aside, *said)

    @property
    def headers_again(self) -> list[int]:
        """Lines between the rows that are the header again."""
        own, first = self.names[:2], self.lines[0] if self.lines else 0
        found = ([split_unit(c.strip())[0] for c in cells[:2]] for _, cells in self.titles)
        return [n for (n, _), f in zip(self.titles, found, strict=True) if n > first and tuple(f) == own]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The header without units."""
        return tuple(split_unit(h)[0] for h in self.header)

    def unit(self, column: int) -> str:
        """The unit that stands in a column's header, or nothing."""
        return split_unit(self.header[column])[1]

    def find(self, pattern: str, besides: Collection[int | None] = ()) -> int | None:
        """The first column, `besides` some, whose name, without its unit, is all of a regular expression in any case."""
        at = (i for i, n in enumerate(self.names) if re.fullmatch(pattern, n, re.IGNORECASE))
        return next((i for i in at if i not in besides), None)

    def one_of(self, names: Iterable[str]) -> str | None:
        """The first of these columns that the table has."""
        return next((c for c in names if c in self), None)

    def with_cells(self, name: str, cells: Iterable[str]) -> Table:
        """The table and one column more."""
        return replace(self, header=(*self.header, name), columns=(*self.columns, Cells.of(cells)))

    def with_column(self, name: str, values: ArrayLike) -> Table:
        """The table and one column of numbers (rows,) more, empty where they are NaN."""
        cells = ["" if v != v else repr(v) for v in np.asarray(values, dtype=float).tolist()]
        return self.with_cells(name, (c.replace(".", ",") for c in cells) if self.decimal_comma else cells)

    def refuse_remarks(self) -> None:
        """FileError where something between the rows is in none of the columns, no comment and not the header again."""
        comments = [n for n, cells in self.titles if cells[0].lstrip().startswith(COMMENTS)]
        if left := self.without_titles([*comments, *self.headers_again]).left_out:
            raise FileError(f"expected rows of numbers alone below the header; {left[0]}", file=self.file)

    def without_titles(self, lines: Collection[int]) -> Table:
        """The table without the titles in these lines, which have become columns."""
        return replace(self, titles=tuple(t for t in self.titles if t[0] not in lines))

    def repeated(self, times: int) -> Table:
        """Every row so often, one below the other."""

        def each(values: Iterable[T]) -> list[T]:
            return [v for v in values for _ in range(times)]

        columns = tuple(Cells.of(each(c)) for c in self.columns)
        return replace(self, columns=columns, lines=each(self.lines))

    def with_points(self, column: int) -> Cells:
        """A column of numbers as text, with decimal points."""
        return with_points(self.columns[column]) if self.decimal_comma else self.columns[column]

    def numbers(self, column: int, *, blank: bool = True) -> Floats:
        """A column as a workshop writes it; NaN where nothing was read, if it may be `blank`. FileError names the line of what is no
        number."""

        def found(row: int) -> str:
            cell = [*self.columns[column]][row]
            expected = "a finite number" if cell.strip().lower().strip("+-") in ("nan", "inf") else "a number"
            shown = repr(cell) if cell else "an empty cell"
            return f"column '{self.header[column]}': expected {expected}; found {shown}"

        def one(cell: str, row: int) -> float:
            value = number(cell, Spelling())
            if value is None:
                place = f"{column_letter(column)}{self.lines[row]}"
                self.fail(f"{found(row)} (cell {place})", row)
            return value

        if column not in self._read:
            self._read[column] = self.with_points(column).numbers(one)
        self.check(blank | ~np.isnan(self._read[column]), found)
        return self._read[column]

    def is_numeric(self, column: int) -> bool:
        """Whether all cells of a column are numbers or say that nothing was read."""
        try:
            self.numbers(column)
        except FileError:
            return False
        return True

    def text(self, column: str) -> list[str]:
        """Cells of a column by its name; raises `FileError` where there is none."""
        return [unguarded(cell) for cell in self.columns[self._named(column)]]

    def _named(self, column: str) -> int:
        if column not in self:
            near = suggestion(column, self.header)
            raise MissingColumnError(
                f"missing column '{column}'{near}; found {', '.join(self.header)}", file=self.file
            )
        return self.header.index(column)

    def si(self, column: str, *, blank: bool = False) -> Floats:
        """A column by its name, plain numbers alone, in SI; with `blank`, empty cells are NaN (a value that was not read)."""

        def one(cell: str, row: int) -> float:
            if blank and cell.lower() in ("", "nan", "na"):
                return np.nan
            try:
                value, expected = number_in(cell), "a finite number"
            except ValueError:
                value, expected = np.inf, "a number"
            if not np.isfinite(value):
                empty = "an empty cell; what holds for several rows stands in each of them"
                self.fail(
                    f"column '{column}': expected {expected}; found {repr(cell) if cell else empty}", row
                )
            return value

        found = self.with_points(self._named(column)).numbers(one)
        return found * self.sizes[column] if self.sizes.get(column, 1.0) != 1.0 else found

    def block(self, names: Sequence[str], *, blank: bool, missing: float | None = np.nan) -> Floats:
        """(n, names) of `si`; a column that is not there is `missing`, or refused where that is None."""
        there = [c in self or missing is None for c in names]
        columns = [
            self.si(c, blank=blank) if t else np.full(len(self), missing)
            for c, t in zip(names, there, strict=True)
        ]
        return np.column_stack(columns)

    def refuse_unknown(self, known: Sequence[str], list_of: str) -> None:
        """`FileError` for the first column that is none of these; `list_of` stands before their names."""
        for column in self.header:
            if column not in known:
                near = suggestion(column, known)
                self.fail(f"unknown column '{column}'{near}; {list_of} {', '.join(known)}")

    def fail(self, message: str, row: int | None = None) -> NoReturn:
        """Raise `FileError` that names a row, or the header."""
        raise FileError(message, file=self.file, line=(self.top or None) if row is None else self.lines[row])

    def check(self, good: object, message: Callable[[int], str]) -> None:
        """`FileError` at the first row where a condition (n,) does not hold."""
        wrong = np.flatnonzero(~np.asarray(good, dtype=bool))
        if wrong.size:
            self.fail(message(int(wrong[0])), int(wrong[0]))


def column_letter(index: int) -> str:
    """``A`` for 0, ``AB`` for 27, as spreadsheets name columns."""
    before, last = divmod(index, 26)
    return (column_letter(before - 1) if before else "") + chr(65 + last)
