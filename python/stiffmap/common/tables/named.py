"""Tables whose columns have known names, each with its unit, for all commands that take points, forces or frequencies.

``x [mm]``, ``x (mm)`` or ``x_mm``; order and case are free. Cells are separated by ; tab | , or blanks, with decimal points or
commas; lines that begin with # are remarks. The first line is the header.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.common.tables.lines import finite_number, rows_of
from stiffmap.common.units import name_and_unit, unit_of
from stiffmap.common.value_units import read_value

Rows = Iterable[tuple[int, Sequence[str]]]
"""Line and cells; the header comes first."""
TURNING = {"rpm": math.pi / 30, "1/min": math.pi / 30, "rad/s": 1.0}
PER = re.compile(r"_(?:per_)?(min|s|tooth)$")
WORD = "word"
"""In place of a unit: the column holds text."""
QUANTITIES = {"m": "length", "N": "force", "N*m": "moment", "rad": "angle"}


@dataclass(frozen=True)
class Known:
    """Names that a table may have."""

    units: Mapping[str, str]
    """Name -> SI unit; empty for a plain number, `WORD` for text."""
    usual: Mapping[str, str]
    """Name -> how a table usually writes it."""
    aliases: Mapping[str, str]
    renamed: Callable[[str, str], tuple[str, str]] = lambda name, unit: (name, unit)
    """Name and unit of a column whose unit decides what it is."""
    assumed: Mapping[str, str] | None = None
    """Name -> unit of a column that names none; None: it must."""
    blank: bool = False
    """Whether cells may be empty, which are NaN then."""


@dataclass(eq=False)
class NamedTable:
    """Columns by their known names, SI."""

    file: str
    lines: list[int]
    """Of the rows in the file."""
    first: int
    """Line of the header."""
    header: dict[str, str]
    """Name -> the name that the table uses."""
    units: dict[str, str]
    size: dict[str, float]
    """Name -> SI size of the unit that the table uses."""
    values: dict[str, Any]
    """Name -> numbers (n,), or words."""

    def fail(self, message: str, name: str = "", row: int | None = None) -> NoReturn:
        """Raise FileError at a column and, where one is given, a row."""
        line = self.first or None if row is None else self.lines[row]
        raise FileError(message, file=self.file, line=line, key=self.header.get(name, name))

    def block(self, names: Sequence[str], missing: float = 0.0) -> Floats:
        """(n, names); `missing` where there is no column."""
        return np.stack([self.values.get(c, np.full(len(self.lines), missing)) for c in names], axis=1)

    def check(self, name: str, good: Any, expected: str) -> None:
        """FileError at the first row where a condition (n,) does not hold and a number is there."""
        value = np.asarray(self.values[name])
        wrong = np.flatnonzero(~np.asarray(good) & ~np.isnan(value))
        if wrong.size:
            found = float(value[wrong[0]] / self.size.get(name, 1.0))
            self.fail(f"expected {expected}, found {found:.12g}", name, int(wrong[0]))


def read_named(path: Path, known: Known) -> NamedTable:
    """A text or a workbook. Raises FileError naming file, line and column, what was expected and what was found."""
    return named(rows_of(path), known, str(path))


def named(rows: Rows, known: Known, file: str) -> NamedTable:
    """Columns of rows, the header first; raises FileError."""
    (first, heads), *body = rows
    out = NamedTable(file, [line for line, _ in body], first, {}, {}, {}, {})
    if not body:
        out.fail("expected a header and a line for each row below it")
    for i, head in enumerate(heads):
        name, unit, size = _meaning(head.strip(), known, out)
        if name in out.header:
            out.fail(f"a column is given twice, as '{out.header[name]}' and '{head.strip()}'")
        out.header[name], out.units[name], out.size[name] = head.strip(), unit, size
        cells = [row[i].strip() for _, row in body]
        words = known.units[name] == WORD
        out.values[name] = cells if words else size * _numbers(cells, name, out, known.blank)
    return out


def _numbers(cells: Sequence[str], name: str, table: NamedTable, blank: bool) -> Floats:
    out = np.empty(len(cells))
    for i, cell in enumerate(cells):
        try:
            out[i] = finite_number(cell, ("",) if blank else ())
        except ValueError as problem:
            expected, found = problem.args
            table.fail(f"expected {expected}, found {found}", name, i)
    return out


def _meaning(head: str, known: Known, table: NamedTable) -> tuple[str, str, float]:
    """Name of a column, its unit as written, and the SI size of that."""
    text, unit = name_and_unit(head)
    name = re.sub(r"\s+", "_", text.lower())
    names = {*known.units, *known.aliases}
    if not unit and name not in names:
        cuts = [m.start() for m in re.finditer("_", name) if name[: m.start()] in names]
        if cuts:
            name, unit = name[: cuts[-1]], PER.sub(r"/\1", text[cuts[-1] + 1 :])
            unit = {"N_m": "N*m"}.get(unit, unit)
    name, unit = known.renamed(name, unit)
    name = known.aliases.get(name, name)
    usual = known.usual.get(name, name)
    if name not in known.units:
        shown = ", ".join(known.usual.get(n, n) for n in known.units)
        table.fail(f"unknown column '{head}'; known: {shown}, each with its unit, as in x [mm] or x_mm")
    si = known.units[name]
    if si in ("", WORD):
        return name, unit, 1.0
    if not unit and known.assumed is not None:
        unit = known.assumed.get(name, "")
    if not unit:
        table.fail(
            f"the unit is missing: write {usual}; expected a unit such as in {usual}, found none", head
        )
    try:
        return name, unit, size_in(unit, si)
    except StiffmapError:
        table.fail(f"expected a unit such as in {usual}, found {unit}", head)


def size_in(unit: str, si: str) -> float:
    """SI size of a unit that has the dimension of `si`, as experiments, effects and workshops write it; StiffmapError."""
    if si == "rad/s" and unit in TURNING:
        return TURNING[unit]
    if unit == si or (si == "percent" and unit == "%"):
        return 1.0
    spelled = unit_of(unit, QUANTITIES[si]) if si in QUANTITIES else None
    try:
        return read_value(f"1 {unit}", si)
    except StiffmapError:
        if spelled is None or spelled.mass:
            raise
        return spelled.size
