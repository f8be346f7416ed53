"""Columns of a table of forces: their names, units and numbers, and the place of what is wrong."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite, pi
from os import PathLike
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from stiffmap.common.broadcasting import Floats, given_path
from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.common.number_text import number_in
from stiffmap.common.pose_tables import rows_of
from stiffmap.common.units import name_and_unit
from stiffmap.common.workbook import workbook_lines
from stiffmap.workspace.performance.quantities import quantity

COLUMNS = {
    "feed_per_tooth": ("feed_per_tooth_mm", "m"), "fx": ("Fx_N", "N"), "fy": ("Fy_N", "N"), "fz": ("Fz_N", "N"),
    "teeth": ("teeth", ""), "axial": ("axial_mm", "m"), "radial": ("radial_mm", "m"), "diameter": ("diameter_mm", "m"),
    "spindle": ("spindle_rpm", "rad/s"), "side": ("side", ""), "helix": ("helix_deg", "rad"), "time": ("time_s", "s"),
    "feed": ("feed_mm_min", "m/s"),
}  # fmt: skip
"""Name -> how a table usually writes it, and its SI unit."""
NEEDED = ("feed_per_tooth", "fx", "fy", "fz", "teeth", "axial")
ALIASES = {
    "c": "feed_per_tooth", "chip": "feed_per_tooth", "depth": "axial", "ap": "axial", "ae": "radial", "width": "radial",
    "rpm": "spindle", "z": "teeth", "n_teeth": "teeth", "t": "time",
}  # fmt: skip
PER_TOOTH = re.compile(r"(/|_per_|_)tooth$")


@dataclass(eq=False)
class Columns:
    """Numbers by the names of `COLUMNS`, SI."""

    file: str
    lines: list[int]
    """Of the rows in the file."""
    header: dict[str, str]
    """Name -> the name that the table uses."""
    values: dict[str, Any]
    size: dict[str, float]
    """Name -> SI size of the unit that the table uses."""

    def fail(self, message: str, name: str = "", row: int | None = None) -> NoReturn:
        """Raise FileError at a column and a row."""
        line = None if row is None else self.lines[row]
        raise FileError(message, file=self.file, line=line, key=self.header.get(name, name))

    def above_zero(self, name: str, row: int, default: float = 0.0) -> float:
        """A number that must be above zero."""
        value = float(self.values[name][row]) if name in self.values else default
        if not value > 0:
            self.fail(f"expected a number above zero, found {value / self.size.get(name, 1.0):g}", name, row)
        return value

    def numbers(self, cells: list[str], name: str) -> Floats:
        """(n,) SI; FileError where a cell is no finite number."""
        out = np.empty(len(cells))
        for i, cell in enumerate(cells):
            try:
                out[i] = number_in(cell)
            except ValueError:
                self.fail(f"expected a number, found {cell!r}", name, i)
            if not isfinite(out[i]):
                self.fail(f"expected a finite number, found {cell}", name, i)
        return out * self.size[name]


def columns_of(
    table: str | PathLike[str] | Mapping[str, Any], defaults: Mapping[str, Any], sheet: str | None
) -> Columns:
    """The columns of a file or a mapping; `defaults`, SI, where it has none of that name. Raises FileError."""
    file = "table" if isinstance(table, Mapping) else str(table)
    rows = (
        _of_mapping(table)
        if isinstance(table, Mapping)
        else _of_file(given_path(table, "table", "a file or a mapping of columns"), sheet)
    )
    out = Columns(file, [line for line, _ in rows[1:]], {}, {}, {})
    if len(rows) < 2:
        out.fail("expected a line of names and a line for each cut")
    for i, header in enumerate(rows[0][1]):
        name, size = _meaning(header, out)
        if name in out.header:
            out.fail(f"a column is given twice, as '{out.header[name]}' and '{header}'")
        out.header[name], out.size[name] = header, size
        cells = [row[i].strip() for _, row in rows[1:]]
        out.values[name] = np.array(cells) if name == "side" else out.numbers(cells, name)
    if {"feed", "feed_per_tooth"} <= set(out.values):
        out.fail(f"expected one feed, found '{out.header['feed_per_tooth']}' and '{out.header['feed']}'")
    for name, value in defaults.items():
        out.values.setdefault(name, np.full(len(out.lines), value))
    needed = ("feed", "spindle", *NEEDED[1:]) if "feed" in out.values else NEEDED
    if missing := [COLUMNS[n][0] for n in needed if n not in out.values]:
        out.fail(f"missing column '{missing[0]}'; needed: {', '.join(COLUMNS[n][0] for n in needed)}")
    if "feed" in out.values:
        each = [[out.above_zero(n, i) for n in ("feed", "spindle", "teeth")] for i in range(len(out.lines))]
        feed, spindle, teeth = np.array(each).T
        del out.values["feed"]
        out.values["feed_per_tooth"] = feed * 2 * pi / spindle / teeth
        out.header["feed_per_tooth"] = out.header["feed"]
    return out


def _meaning(header: str, c: Columns) -> tuple[str, float]:
    """Name of a column, and the SI size of its unit."""
    plain, unit = name_and_unit(header.replace("(", "[").replace(")", "]"))
    name = re.sub(r"\s+", "_", plain.lower())
    cuts = [
        m.start() for m in re.finditer("_", name) if not unit and name[: m.start()] in {*COLUMNS, *ALIASES}
    ]
    if cuts and name not in {*COLUMNS, *ALIASES}:
        name, unit = name[: cuts[-1]], plain[cuts[-1] + 1 :].replace("_min", "/min")
    unit = "rpm" if name == "rpm" else unit
    length = PER_TOOTH.sub("", unit)
    if (name == "feed" and length != unit) or (name == "fz" and length in ("mm", "um", "µm", "in")):
        name = "feed_per_tooth"  # fz is a force in N, and a feed per tooth in mm
    name = ALIASES.get(name, name)
    if name not in COLUMNS:
        c.fail(f"unknown column '{header}'; known: {', '.join(n for n, _ in COLUMNS.values())}")
    usual, si = COLUMNS[name]
    if not si:
        return name, 1.0
    if si == "rad/s" and unit in ("rpm", "1/min"):
        return name, pi / 30
    try:
        return name, quantity(
            f"1 {length if name == 'feed_per_tooth' else unit}", "rpm" if si == "rad/s" else si
        )
    except StiffmapError:
        more = "; a feed is in mm/tooth or mm/min" if name in ("feed", "feed_per_tooth") else ""
        c.fail(f"expected a unit such as in {usual}, found {unit or 'none'}{more}", header)


def _of_mapping(table: Mapping[str, Any]) -> list[tuple[int, list[str]]]:
    """Rows counted from 1, the header first; single values stand for all rows."""
    columns = {str(k): [table[k]] if np.ndim(table[k]) == 0 else list(table[k]) for k in table}
    count = max((len(v) for v in columns.values()), default=0)
    for name, cells in columns.items():
        if len(cells) not in (1, count):
            raise FileError(f"expected {count} numbers or one, found {len(cells)}", file="table", key=name)
    full = [[str(v) for v in (cells if len(cells) == count else cells * count)] for cells in columns.values()]
    return [(0, list(columns)), *((i, list(row)) for i, row in enumerate(zip(*full, strict=True), 1))]


def _of_file(path: Path, sheet: str | None) -> list[tuple[int, list[str]]]:
    """Lines of a CSV file or a workbook, all as long as the header."""
    if path.suffix.lower() in (".xlsx", ".xlsm"):
        rows = list(workbook_lines(path, sheet)[1]())
        return [(n, row + [""] * (len(rows[0][1]) - len(row))) for n, row in rows]
    rows = rows_of(path)
    for line, row in rows:
        if len(row) != len(rows[0][1]):
            raise FileError(f"expected {len(rows[0][1])} values, found {len(row)}", file=str(path), line=line)
    return rows
