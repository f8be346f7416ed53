"""Tables of measured forces: means per feed, or signals over time that become means."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import pi
from os import PathLike
from typing import Any

import numpy as np

from stiffmap.common.broadcasting import Floats, instance_of
from stiffmap.machining.process.description import SIDES, Cut, EndMill, Process, Tool
from stiffmap.machining.process.identify.columns import ForceColumns, columns_of

FORCES = ("fx", "fy", "fz")
SLOT_SIGNS = (-1.0, 1.0, 1.0)
"""Of the mean forces of a slot with positive coefficients."""
THINNEST = 1e-7
"""m, feed per tooth: below, no edge of a tool cuts."""
SAME = 2
"""Decimals of the logarithm of feeds per tooth that count as one feed, which is about 1 %."""


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
    file: str = "table"
    given: frozenset[str] = frozenset()
    """Columns that the table or a process has; what is not there is no number of the cut."""

    @property
    def chip(self) -> Floats:
        """(n,) m, feed per tooth."""
        return np.array([p.chip for p in self.cuts])

    @property
    def feeds(self) -> Floats:
        """(n,) labels of the feeds per tooth that count as different."""
        return np.asarray(np.round(np.log(self.chip), SAME), dtype=float)

    def rows(self, chosen: Any) -> ForceTable:
        """Some of the cuts."""
        index = np.arange(len(self.cuts))[chosen]
        return replace(self, cuts=tuple(self.cuts[i] for i in index), force=self.force[index], signals=())


def read_table(
    table: str | PathLike[str] | Mapping[str, Any], process: Process | None = None, sheet: str | None = None
) -> ForceTable:
    """A CSV file, a workbook, or a mapping (a data frame) of columns as `identify_process` takes them.

    Columns may be single values; `process` gives what no column says. With a column of time the rows are samples, and those
    of one cut become their mean over whole revolutions. Raises FileError naming file, line, column, expected and found.
    """
    c = columns_of(table, {} if process is None else _defaults(process), sheet)
    force = np.stack([c.values[n] for n in FORCES], axis=1)
    given = frozenset(c.values)
    if "time" not in c.values:
        cuts = tuple(_cut(c, i) for i in range(len(c.lines)))
        return _slot_signs(ForceTable(cuts, force, file=c.file, given=given))
    if "spindle" not in c.values:
        c.fail("signals over time need a column spindle_rpm")
    keys = [np.unique(c.values[n], return_inverse=True)[1] for n in sorted(given - {"time", *FORCES})]
    same = np.unique(np.stack(keys, axis=1), axis=0, return_inverse=True)
    cuts_of, means, signals = [], [], []
    for group in range(len(same[0])):
        here = np.flatnonzero(same[1].ravel() == group)
        cuts_of.append(_cut(c, int(here[0])))
        one = _whole_turns(c, here, force)
        means.append(one.force.mean(axis=0))
        signals.append(one)
    return _slot_signs(ForceTable(tuple(cuts_of), np.array(means), tuple(signals), (), c.file, given))


def _whole_turns(c: ForceColumns, here: Any, force: Floats) -> Signals:
    time, turn = c.values["time"][here], 2 * pi / c.above_zero("spindle", int(here[0]))
    for i in np.flatnonzero(np.diff(time) <= 0)[:1]:
        what = f"expected rising times in a cut, found {time[i + 1]:g} s behind {time[i]:g} s"
        c.fail(what, "time", here[i + 1])
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    turns = int((time[-1] - time[0] + step) / turn * (1 + 1e-9))
    if len(time) < 8 or turns < 1:
        c.fail(
            f"expected eight or more samples over a revolution ({turn:g} s) or more for each cut, found {len(time)} over "
            f"{time[-1] - time[0] + step:g} s", "time", here[0],
        )  # fmt: skip
    keep = min(len(time), round(turns * turn / step))
    return Signals(time[:keep], force[here[:keep]])


def _slot_signs(table: ForceTable) -> ForceTable:
    """Dynamometers count force on the part, or sizes: in a slot positive coefficients fix the signs."""
    if any(p.cut.side != "slot" for p in table.cuts):
        return table
    turned = np.sign(table.force.sum(axis=0)) * np.array(SLOT_SIGNS) < 0
    if not turned.any():
        return table
    sign = np.where(turned, -1.0, 1.0)
    names = ", ".join(n.capitalize() for n, t in zip(FORCES, turned, strict=True) if t)
    note = f"the sign of {names} was turned: in a slot positive coefficients give -, +, +"
    return replace(
        table,
        force=table.force * sign,
        signals=tuple(replace(s, force=s.force * sign) for s in table.signals),
        notes=(*table.notes, note),
    )


def _defaults(process: Process) -> dict[str, Any]:
    instance_of(process, Process, "process", "a Process, as load_process gives it")
    c, t = process.cut, process.tool
    return {
        "teeth": t.teeth, "axial": c.axial, "diameter": t.diameter, "radial": c.radial, "side": c.side,
        "spindle": process.spindle, "helix": t.helix,
    }  # fmt: skip


def _cut(c: ForceColumns, i: int) -> Process:
    """One row's tool and engagement; its law is to be found."""
    way = str(c.values["side"][i]) if "side" in c.values else "slot"
    if way not in SIDES:
        c.fail(f"expected one of {', '.join(SIDES)}, found '{way}'", "side", i)
    if way != "slot" and not {"diameter", "radial"} <= set(c.values):
        c.fail("a cut that is no slot needs the columns diameter_mm and radial_mm")
    chip, axial, teeth = (c.above_zero(n, i) for n in ("feed_per_tooth", "axial", "teeth"))
    diameter, spindle = c.above_zero("diameter", i, 0.01), c.above_zero("spindle", i, 200 * pi)
    radial = diameter if way == "slot" else c.above_zero("radial", i)
    if teeth != int(teeth) or teeth > 1000:
        c.fail(f"expected a whole number from 1 to 1000, found {teeth:g}", "teeth", i)
    if radial > diameter * (1 + 1e-12):
        c.fail(
            f"expected at most the diameter, {1e3 * diameter:g} mm, found {1e3 * radial:g} mm", "radial", i
        )
    if not THINNEST <= chip <= diameter / 2:
        c.fail(
            f"expected {1e3 * THINNEST:g} to {500 * diameter:g} mm per tooth, found {1e3 * chip:.4g}; is it a feed per tooth, "
            "feed [mm/tooth], or per minute, feed [mm/min]?", "feed_per_tooth", i,
        )  # fmt: skip
    tool = Tool(diameter, int(teeth), float(c.values["helix"][i]) if "helix" in c.values else 0.0)
    return Process(
        "measured", tool, EndMill(0, 0), spindle, chip * teeth * spindle / (2 * pi), Cut(way, radial, axial)
    )
