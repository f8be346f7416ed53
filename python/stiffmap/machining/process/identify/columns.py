"""Columns of a table of forces: their names, units and numbers, and the place of what is wrong."""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import pi
from os import PathLike
from typing import Any

import numpy as np

from stiffmap.common.broadcasting import given_path
from stiffmap.common.errors import FileError
from stiffmap.common.tables.cells import Cells
from stiffmap.common.tables.named import WORD, Known, NamedTable, named, read_named
from stiffmap.common.tables.sheet import Sheet

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
PER_EDGE = ("feed_per_tooth", "c", "chip")


class ForceColumns(NamedTable):
    """Numbers by the names of `COLUMNS`, SI."""

    def above_zero(self, name: str, row: int, default: float = 0.0) -> float:
        """A number that must be above zero."""
        value = float(self.values[name][row]) if name in self.values else default
        if not value > 0:
            self.fail(f"expected a number above zero, found {value / self.size.get(name, 1.0):g}", name, row)
        return value


def _renamed(name: str, unit: str) -> tuple[str, str]:
    """A feed by its unit: ``fz`` is a force in N, and a feed per tooth in mm."""
    length = PER_TOOTH.sub("", unit)
    if name == "feed" and length == unit and not unit.endswith(("/min", "/s")):
        return name, f"{unit or 'none'}; a feed is in mm/tooth or mm/min"
    if name == "feed_per_tooth" and unit.endswith(("/min", "/s")):
        return name, f"{unit}; a feed is in mm/tooth or mm/min"
    if name == "rpm":
        return name, "rpm"
    feed = (name == "feed" and length != unit) or (name == "fz" and length in ("mm", "um", "µm", "in"))
    return ("feed_per_tooth", length) if feed else (name, length if name in PER_EDGE else unit)


KNOWN = Known(
    {n: WORD if n == "side" else si for n, (_, si) in COLUMNS.items()},
    {n: usual for n, (usual, _) in COLUMNS.items()},
    ALIASES,
    _renamed,
)


def columns_of(
    table: str | PathLike[str] | Mapping[str, Any], defaults: Mapping[str, Any], sheet: str | None
) -> ForceColumns:
    """The columns of a file or a mapping; `defaults`, SI, where it has none of that name. Raises FileError."""
    if isinstance(table, Mapping):
        found = named(_of_mapping(table), KNOWN)
    else:
        found = read_named(given_path(table, "table", "a file or a mapping of columns"), KNOWN, sheet)
    out = ForceColumns(**vars(found))
    if "side" in out.values:
        out.values["side"] = np.array(out.values["side"])
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


def _of_mapping(table: Mapping[str, Any]) -> Sheet:
    """Rows counted from 1; single values stand for all rows."""
    columns = {str(k): [table[k]] if np.ndim(table[k]) == 0 else list(table[k]) for k in table}
    count = max((len(v) for v in columns.values()), default=0)
    for name, cells in columns.items():
        if len(cells) not in (1, count):
            raise FileError(f"expected {count} numbers or one, found {len(cells)}", file="table", key=name)
    full = [Cells.of(map(str, cells if len(cells) == count else cells * count)) for cells in columns.values()]
    return Sheet("table", tuple(columns), tuple(full), range(1, count + 1), False)
