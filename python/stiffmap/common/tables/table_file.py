"""The file of a table, with what the table does not say itself: what columns are, their units, its header, which of several."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.common.tables.header import split_unit, stated_unit, with_unit
from stiffmap.common.tables.sheet import Layout
from stiffmap.common.tables.table import Table
from stiffmap.common.units import SPELLINGS

SIGNS = ("+", "-", "−")
"""Before a header: the column as it is, or its numbers with the other sign."""


NOTE = "note"
"""What a column is that is left out."""


@dataclass(frozen=True)
class TableFile(os.PathLike[str]):
    """The file of a table and what it does not say itself; it can be given wherever a file of a table can."""

    path: str | os.PathLike[str]
    columns: Mapping[str, str] = field(default_factory=dict)
    """What a column is, by its header or number: ``{"x": "Xist", "y": "2"}``, with the other sign ``{"fz": "-Last"}``; left out:
    ``{"note": "Q|R"}``."""
    units: Mapping[str, str] = field(default_factory=dict)
    """Unit of a column by what it is or its name, ``{"x": "mm"}``, or of all of a quantity that have none, ``{"length": "mm"}``."""
    sheet: str | None = None
    """Of a workbook; None: the first one that holds a table."""
    header: Sequence[str] = ()
    """Names of the columns of a table that has none."""
    which: int | None = None
    """Of several tables on a sheet, from 1."""

    def __fspath__(self) -> str:
        return os.fspath(self.path)

    def __str__(self) -> str:
        return os.fspath(self.path)


def table_file(path: str | os.PathLike[str]) -> TableFile:
    """A file as it is, or a path of which nothing is said."""
    return path if isinstance(path, TableFile) else TableFile(path)


def layout_of(file: TableFile, known: Callable[[str], bool], **more: Any) -> Layout:
    """Where the table lies; `known` and `more` as of `Layout`."""
    numbered = any(h.strip("+-").isdigit() for many in file.columns.values() for h in many.split("|"))
    return Layout(known, tuple(file.header), numbered, file.which, **more)


def with_names(file: TableFile, table: Table, meaning: Callable[[str], str]) -> Table:
    """The table with the names that are said, without other columns of these meanings; `meaning` of a header. Raises StiffmapError."""
    many = [(n, h) for n, some in file.columns.items() for h in some.split("|")]
    taken = {find_column(_unsigned(h, table.header), table.header, table.file): (n, h) for n, h in many}
    header, columns = list(table.header), list(table.columns)
    for i, (name, wanted) in taken.items():
        header[i] = with_unit(name, table.unit(i))
        if wanted[:1] in SIGNS[1:] and wanted not in table.header:
            columns[i] = table.with_column(name, 0.0 - table.numbers(i)).columns[-1]
    kept = [i for i, h in enumerate(table.header) if i in taken or meaning(h) not in file.columns]
    kept = [i for i in kept if taken.get(i, ("", ""))[0] != NOTE]
    return replace(table, header=tuple(header[i] for i in kept), columns=tuple(columns[i] for i in kept))


def with_units(file: TableFile, table: Table, meaning: Callable[[str], tuple[str, str, str]]) -> Table:
    """The table with the units that are said; that of a line above it goes to columns that have none. `meaning` of a header: what it is,
    its unit as written, and its quantity. Raises StiffmapError."""
    header, used = list(table.header), {*SPELLINGS, "joints"}
    for i, h in enumerate(table.header):
        name, own, quantity = meaning(h)
        said = [n for n in (name, h, table.names[i], *([] if own else [quantity])) if n in file.units]
        used |= {*said}
        unit = file.units[said[0]] if said else ""
        if not (unit or own) and quantity:
            unit = stated_unit(table.above, quantity)
        header[i] = with_unit(table.names[i], unit) if unit else h
    if wrong := [n for n in file.units if n not in used]:
        what = f"no column has this name or meaning; columns: {', '.join(table.header)}"
        raise StiffmapError(f"{table.file}: --unit {wrong[0]}: {what}")
    return replace(table, header=tuple(header))


def _unsigned(wanted: str, headers: Sequence[str]) -> str:
    return wanted[1:].strip() if wanted[:1] in SIGNS and wanted not in headers else wanted


def refuse_options(path: str | os.PathLike[str], expected: str) -> None:
    """FileError where something is said of a table that is none."""
    if isinstance(path, TableFile) and path != TableFile(path.path):
        raise FileError(f"columns, units and the like are of a table; found {expected}", file=str(path))


def find_column(wanted: str, headers: Sequence[str], file: str) -> int:
    """Index of a column by its header, with or without its unit, by how that begins, or by its number from 1; FileError."""
    exact = [i for i, h in enumerate(headers) if wanted in (h, split_unit(h)[0])]
    loose = [i for i, h in enumerate(headers) if h.lower().startswith(wanted.lower())]
    found = exact or (loose if len(loose) == 1 else [])
    if not found and wanted.isdigit() and 1 <= int(wanted) <= len(headers):
        return int(wanted) - 1
    if not found:
        raise FileError(f"--map: no column '{wanted}'; there are: {', '.join(headers)}", file=file)
    return found[0]
