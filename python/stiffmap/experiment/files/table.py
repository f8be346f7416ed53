"""data.csv as a table, its first line the header, and its units to SI; one that is needed and not declared is an error."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

from stiffmap.common.errors import FileError
from stiffmap.common.tables.cells import filled, packed
from stiffmap.common.tables.header import refuse_twice, split_unit
from stiffmap.common.tables.lines import decimal_comma, even, lines_of
from stiffmap.common.tables.sheet import STATISTICS
from stiffmap.common.tables.table import Table
from stiffmap.common.units import known, name_and_unit, size_of, unit_of
from stiffmap.experiment.files.fields import base_of, known as known_columns, quantity_of
from stiffmap.experiment.files.schema import ExperimentFile

COMMON = ("length", "force", "angle")
"""Quantities whose columns have one unit, where a column has none of its own."""
ANGLES = ("rad", "mrad", "deg")
TIMES = {"hours": ("h", "hour", "hours"), "temperature": ("°c", "degc", "c")}


def read_table(path: Path, expected: int | None = None) -> Table:
    """Cells of a text or workbook with a header line and, where it is known, an expected number of rows; raises `FileError`."""
    _, read_lines, separator = lines_of(path)

    def rows() -> Iterator[tuple[int, list[str]]]:
        return ((n, cells) for n, cells in read_lines() if filled(cells))

    data = rows()
    header = tuple(c.strip() for c in next(data, (1, []))[1])
    if not header:
        raise FileError("the file is empty", file=str(path))
    counted = header[0] in ("", "row", "Unnamed: 0")  # of R and pandas
    spare = int(counted and "id" in header)  # that column says nothing more
    if counted and not spare:
        header = ("id", *header[1:])
    refuse_twice(header, str(path), 1)
    columns, lines = packed(even(data, len(header), str(path), separator), len(header))
    header, columns = header[spare:], columns[spare:]
    cells = (c for _, c in islice(rows(), 1, None))
    comma = separator not in ("", ",") and decimal_comma(cells, separator)
    if not lines:
        raise FileError("expected a header line and at least one row", file=str(path))
    first, last = next(iter(columns[0])), columns[0].last
    letters = first.isalpha() and len(first) == len(last)  # rows a, b, c to n
    if STATISTICS.fullmatch(last) and not (letters or STATISTICS.fullmatch(first)):
        raise FileError(f"expected rows of readings alone; found '{last}'", file=str(path), line=lines[-1])
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


class Units:
    """SI sizes of the units that a file declares, of all columns of a quantity or of single ones."""

    def __init__(self, model: ExperimentFile, file: str) -> None:
        self.file = file
        given = model.units.model_dump(exclude_none=True, exclude={"temperature"})
        self.common = {name: size_of(given.pop(name)) for name in COMMON if name in given}
        if "force" in self.common:
            self.common["moment"] = self.common["force"] * self.common["length"]
        joints = {f"{name}2": c.unit for name, c in model.command.items()}
        joints |= {name: c.unit for name, c in (model.joints | model.command).items()}
        self.own = {name: size_of(u) for name, u in (given | joints).items()}
        self.joints = {name: "angle" if unit in ANGLES else "length" for name, unit in joints.items()}
        self.columns = {*known_columns(), *self.joints}

    def of_header(self, table: Table, whole: Collection[str] = ()) -> Table:
        """The table with the bare names of columns such as ``x [mm]``, ``x_mm`` and ``X`` and the SI sizes of their units: those of
        the header, else those of the file. Names in `whole` are bare. Raises `FileError`."""
        split = [(h, "") if h in whole else self._split(h) for h in table.header]
        names = tuple(name for name, _ in split)
        refuse_twice(names, table.file, 1)
        of_header = {name: self._written(name, unit, table) for name, unit in split if unit}
        return replace(table, header=names, sizes={n: self.size(n) for n in names} | of_header)

    def size(self, column: str, default: float | None = None) -> float:
        """SI size of the unit of a column, its standard deviation or its command, as the file declares it; `default`, or
        `FileError`, where it declares none."""
        base = base_of(column)
        quantity = self.joints.get(base) or quantity_of(base)
        if base in self.own:
            return self.own[base]
        return 1.0 if quantity in (None, "temperature") else self.of(quantity, column, default)

    def of(self, quantity: str, column: str, default: float | None = None) -> float:
        """The same of all columns of a quantity."""
        size = self.common.get(quantity, default)
        if size is None:
            lost = "force" if quantity == "moment" else quantity
            raise FileError(
                f"units: the unit '{lost}' is not declared (column '{column}' needs it)", file=self.file
            )
        return size

    def _split(self, header: str) -> tuple[str, str]:
        """Name and unit: in the first way of writing that makes it a known column."""
        ways = (name_and_unit(header), split_unit(header))
        each = ((name, unit) for text, unit in ways for name in (text, text.lower()))
        return next((way for way in each if base_of(way[0]) in self.columns), ways[0])

    def _written(self, column: str, text: str, table: Table) -> float:
        """SI size of the unit in a header; where the file declares none, it is that of the column's noise as well."""
        base = base_of(column)
        if text.lower() in TIMES.get(base, ()) or base not in self.columns:
            return 1.0  # what is not known is refused by its name later
        quantity = self.joints.get(base) or quantity_of(base)
        unit = unit_of(text, quantity) if quantity else None
        if quantity is None or unit is None or unit.mass or base in TIMES:
            expected = TIMES[base][0] if base in TIMES else known(quantity) if quantity else "none"
            table.fail(f"unit of column '{column}': expected {expected}; found '{text}'")
        self.own.setdefault(base, self.common.get(quantity, unit.size))
        return unit.size
