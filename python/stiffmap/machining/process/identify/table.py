"""Tables of measured forces: means per feed, or signals over time that become means."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import pi
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.common.units import name_and_unit
from stiffmap.machining.process.description import SIDES, Cut, EndMill, Process, Tool

MM = 1e-3
FORCES = ("Fx_N", "Fy_N", "Fz_N")
NEEDED = ("feed_per_tooth_mm", *FORCES, "teeth", "axial_mm")
OTHERS = ("radial_mm", "diameter_mm", "spindle_rpm", "side", "helix_deg", "time_s")
ALIASES = {
    "feed_mm_per_tooth": "feed_per_tooth_mm", "feed_mm_tooth": "feed_per_tooth_mm", "c_mm": "feed_per_tooth_mm",
    "chip_mm": "feed_per_tooth_mm", "fx_n": "Fx_N", "fy_n": "Fy_N", "fz_n": "Fz_N", "depth_mm": "axial_mm", "ap_mm": "axial_mm",
    "ae_mm": "radial_mm", "width_mm": "radial_mm", "rpm": "spindle_rpm", "z": "teeth", "n_teeth": "teeth", "t_s": "time_s",
}  # fmt: skip
"""Other names of columns, in small letters; ``Fx [N]`` is Fx_N."""
SLOT_SIGNS = (-1.0, 1.0, 1.0)
"""Of the mean forces of a slot with positive coefficients."""


@dataclass(frozen=True, eq=False)
class Signals:
    """One cut over time: (k,) s and (k, 3) N."""

    time: Floats
    force: Floats


@dataclass(frozen=True, eq=False)
class ForceTable:
    """Means of n cuts, SI, in the axes of `mean_force`."""

    cuts: tuple[Process, ...]
    """Tool, speeds and engagement of each, with a law of zeros."""
    force: Floats
    """(n, 3) N."""
    signals: tuple[Signals, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def chip(self) -> Floats:
        """(n,) m, feed per tooth."""
        return np.array([p.chip for p in self.cuts])

    def rows(self, chosen: Any) -> ForceTable:
        """Some of the cuts."""
        index = np.arange(len(self.cuts))[chosen]
        return replace(self, cuts=tuple(self.cuts[i] for i in index), force=self.force[index], signals=())


def read_table(table: str | PathLike[str] | Mapping[str, Any], process: Process | None = None) -> ForceTable:
    """A CSV file, or a mapping (a data frame) of columns `NEEDED` and, where they apply, `OTHERS`.

    Columns may be single values; `process` gives what no column says. With a column `time_s` the rows are samples, and
    those of one feed become their mean over whole revolutions. Raises FileError.
    """
    file = str(table) if isinstance(table, str | PathLike) else "table"
    columns = (
        _read_csv(Path(table)) if isinstance(table, str | PathLike) else {str(k): table[k] for k in table}
    )
    columns = _with_defaults({_known(n): v for n, v in columns.items()}, process)
    missing = [n for n in NEEDED if n not in columns]
    if missing:
        raise FileError(f"missing column '{missing[0]}'; needed: {', '.join(NEEDED)}", file=file)
    unknown = [n for n in columns if n not in NEEDED + OTHERS]
    if unknown:
        raise FileError(f"unknown column '{unknown[0]}'; known: {', '.join(NEEDED + OTHERS)}", file=file)
    count = max(np.size(np.asarray(v)) for v in columns.values())
    side = np.broadcast_to(np.asarray(columns.pop("side", "slot"), dtype=str), count)
    values = {n: _numbers(v, n, count, file) for n, v in columns.items()}
    if count < 1:
        raise FileError("the table has no rows", file=file)
    force = np.stack([values[n] for n in FORCES], axis=1)
    if "time_s" not in values:
        cuts = tuple(_cut(values, side, i, file) for i in range(count))
        return _slot_signs(ForceTable(cuts, force))
    if "spindle_rpm" not in values:
        raise FileError("signals over time need a column spindle_rpm", file=file)
    cuts_of, means, signals = [], [], []
    for feed in np.unique(values["feed_per_tooth_mm"]):
        here = np.flatnonzero(values["feed_per_tooth_mm"] == feed)
        one = Signals(values["time_s"][here], force[here])
        turn = 60 / values["spindle_rpm"][here[0]]
        one = _whole_turns(one, turn, file, feed)
        cuts_of.append(_cut(values, side, int(here[0]), file))
        means.append(one.force.mean(axis=0))
        signals.append(one)
    return _slot_signs(ForceTable(tuple(cuts_of), np.array(means), tuple(signals)))


def _known(name: str) -> str:
    """The name of a column as `NEEDED` and `OTHERS` have it; itself where it is none of theirs."""
    plain, unit = name_and_unit(name)
    text = "_".join(p for p in (plain.replace(" ", "_"), unit) if p)
    return next((n for n in NEEDED + OTHERS if n.lower() == text.lower()), ALIASES.get(text.lower(), name))


def _whole_turns(s: Signals, turn: float, file: str, feed: float) -> Signals:
    if len(s.time) < 8 or not (np.diff(s.time) > 0).all():
        raise FileError(f"feed {feed:g} mm: expected eight or more samples at rising times", file=file)
    step = float(np.median(np.diff(s.time)))
    turns = int((s.time[-1] - s.time[0] + step) / turn * (1 + 1e-9))
    if turns < 1:
        raise FileError(
            f"feed {feed:g} mm: the signals are shorter than a revolution ({turn:g} s)", file=file
        )
    keep = min(len(s.time), round(turns * turn / step))
    return Signals(s.time[:keep], s.force[:keep])


def _slot_signs(table: ForceTable) -> ForceTable:
    """Dynamometers count force on the part, or sizes: in a slot positive coefficients fix the signs."""
    if any(p.cut.side != "slot" for p in table.cuts):
        return table
    turned = np.sign(table.force.sum(axis=0)) * np.array(SLOT_SIGNS) < 0
    if not turned.any():
        return table
    sign = np.where(turned, -1.0, 1.0)
    names = ", ".join(n for n, t in zip(FORCES, turned, strict=True) if t)
    note = f"the sign of {names} was turned: in a slot positive coefficients give -, +, +"
    return replace(
        table,
        force=table.force * sign,
        signals=tuple(replace(s, force=s.force * sign) for s in table.signals),
        notes=(*table.notes, note),
    )


def _with_defaults(columns: dict[str, Any], process: Process | None) -> dict[str, Any]:
    if process is None:
        return columns
    c, t = process.cut, process.tool
    given = {
        "teeth": t.teeth, "axial_mm": c.axial / MM, "diameter_mm": t.diameter / MM, "radial_mm": c.radial / MM,
        "side": c.side, "spindle_rpm": process.spindle * 30 / pi, "helix_deg": np.degrees(t.helix),
    }  # fmt: skip
    return {**given, **columns}


def _cut(values: Mapping[str, Floats], side: Any, i: int, file: str) -> Process:
    """One row's tool and engagement; its law is to be found."""

    def at(name: str, default: float) -> float:
        return float(values[name][i]) if name in values else default

    way = str(side[i])
    if way not in SIDES:
        raise FileError(f"side: expected one of {', '.join(SIDES)}, found '{way}'", file=file, line=i + 2)
    if way != "slot" and not {"diameter_mm", "radial_mm"} <= set(values):
        raise FileError("a cut that is no slot needs the columns diameter_mm and radial_mm", file=file)
    diameter = MM * at("diameter_mm", 10.0)
    axial, chip, teeth = MM * at("axial_mm", 0), MM * at("feed_per_tooth_mm", 0), at("teeth", 0)
    radial = diameter if way == "slot" else MM * at("radial_mm", 0)
    spindle = at("spindle_rpm", 6000.0) * pi / 30
    for name, value in (
        ("axial_mm", axial), ("feed_per_tooth_mm", chip), ("diameter_mm", diameter), ("radial_mm", radial),
        ("spindle_rpm", spindle),
    ):  # fmt: skip
        if not value > 0:
            raise FileError(f"{name}: expected a number above zero", file=file, line=i + 2)
    if teeth != int(teeth) or not 1 <= teeth <= 1000:
        raise FileError(
            f"teeth: expected a whole number from 1 to 1000, found {teeth:g}", file=file, line=i + 2
        )
    if radial > diameter:
        raise FileError("radial_mm: expected at most diameter_mm", file=file, line=i + 2)
    tool = Tool(diameter, int(teeth), np.radians(at("helix_deg", 0.0)))
    feed = chip * teeth * spindle / (2 * pi)
    return Process("measured", tool, EndMill(0.0, 0.0), spindle, feed, Cut(way, radial, axial))


def _numbers(values: Any, name: str, count: int, file: str) -> Floats:
    try:
        out = np.broadcast_to(np.asarray(values, dtype=float), (count,)).copy()
    except (TypeError, ValueError) as problem:
        raise FileError(f"{name}: expected {count} numbers or one ({problem})", file=file) from None
    if not np.isfinite(out).all():
        raise FileError(
            f"{name}: expected finite numbers", file=file, line=int(np.argmin(np.isfinite(out))) + 2
        )
    return out


def _read_csv(path: Path) -> dict[str, Any]:
    try:
        with path.open(newline="", encoding="utf-8") as stream:
            rows = [r for r in csv.reader(stream) if r and not r[0].startswith("#")]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FileError(f"cannot be read: {error}", file=str(path)) from None
    if len(rows) < 2:
        raise FileError("expected a line of names and a line for each cut", file=str(path))
    names = [n.strip() for n in rows[0]]
    if len(set(names)) < len(names):
        raise FileError("a column is given twice", file=str(path), line=1)
    wrong = [i for i, r in enumerate(rows) if len(r) != len(names)]
    if wrong:
        raise FileError(
            f"expected {len(names)} values, found {len(rows[wrong[0]])}", file=str(path), line=wrong[0] + 1
        )
    return {n: [r[i].strip() for r in rows[1:]] for i, n in enumerate(names)}


def need(table: ForceTable, count: int) -> None:
    """Raise StiffmapError where fewer cuts or feeds stand in the table."""
    if len(np.unique(np.round(table.chip, 12))) < count:
        raise StiffmapError(
            f"expected forces at {count} or more feeds per tooth, found {len(np.unique(table.chip))}: "
            "the edge coefficients are what does not change with the feed"
        )
