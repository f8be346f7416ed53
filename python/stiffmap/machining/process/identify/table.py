"""Tables of measured forces: columns, units, means per feed, or signals over time that become means."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import isclose, pi
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pandas import DataFrame

from stiffmap.common.broadcasting import Floats, given_path
from stiffmap.common.errors import FileError
from stiffmap.common.tables.cells import Cells
from stiffmap.common.tables.named import WORD, Known, NamedTable, named, read_named
from stiffmap.common.tables.table import Table
from stiffmap.common.tables.table_file import TableFile
from stiffmap.common.units import feed_unit
from stiffmap.machining.process.description import SIDES, Cut, EndMill, Process, Tool
from stiffmap.machining.process.load import FASTEST, THINNEST

ForceColumns = str | PathLike[str] | Mapping[str, object] | DataFrame
COLUMNS = {
    "feed_per_tooth": ("feed_per_tooth_mm", "m"), "fx": ("Fx_N", "N"), "fy": ("Fy_N", "N"), "fz": ("Fz_N", "N"),
    "teeth": ("teeth", ""), "axial": ("axial_mm", "m"), "radial": ("radial_mm", "m"), "diameter": ("diameter_mm", "m"),
    "spindle": ("spindle_rpm", "rad/s"), "side": ("side", ""), "helix": ("helix_deg", "rad"), "time": ("time_s", "s"),
    "feed": ("feed_mm_min", "m/s"), "feed_per_rev": ("feed_mm_rev", "m"),
}  # fmt: skip
"""Name -> how a table usually writes it, and its SI unit."""
NEEDED = ("feed_per_tooth", "fx", "fy", "fz", "teeth", "axial")
DEPTH = "(depth|engagement|immersion|width|(depth|width)_of_cut)"
SPELLED = {
    "feed_per_tooth": "c|ft|f_t|f_z|chip(_?(load|thickness))?|feed_(per|/)_?(tooth|flute|edge)|zahnvorschub|vorschub_pro_zahn",
    "feed": "f|v_?f|(table_)?feed(_?(rate|speed))?|vorschub(sgeschwindigkeit)?", "feed_per_rev": "f_?rev|feed_per_rev(olution)?",
    "axial": f"a_?p|a?doc|depth(_of_cut)?|axial_{DEPTH}|(cutting_)?depth|schnitttiefe", "helix": "helix_angle|drallwinkel",
    "radial": f"a_?e|woc|rdoc|width(_of_cut)?|radial_{DEPTH}|step_?over|eingriffsbreite|schnittbreite",
    "teeth": "z|n_(teeth|z|t)|(number|no\\.?|num\\.?)_of_(teeth|flutes|edges|inserts)|flutes?|edges|tooth|zähne(zahl)?|zähnezahl|schneiden(zahl)?",
    "spindle": "n|rpm|s|spindle_?speed|drehzahl|rotational_speed|speed_of_rotation", "time": "t|zeit",
    "diameter": "d|((tool|cutter|mill)_?)?(diameter|dia\\.?)|tool_d|(werkzeug|fräser)?durchmesser|ø",
    "side": "((milling|cut(ting)?)_)?(mode|type|direction|strategy)|up/down|art|fräsart|milling", "fx": "(feed|vorschub)_?(force|kraft)", "fy": "(cross_?feed|feed_?normal|normal)_?force|vorschubnormalkraft",
    "fz": "(axial|thrust|passive)_?force|(axial|passiv)kraft",
}  # fmt: skip
"""Other spellings; forces along x, y, z have those of all tables."""
SIDE_WORDS = {
    "climb": "climb|down|gleichlauf", "conventional": "conventional|up|gegenlauf", "slot": "(full |voll)?(slot(ting)?|nut)|full",
}  # fmt: skip
"""How tables write a side, with ``milling`` behind it or without."""
MEAN = re.compile(r"(?:^|_)(?:mean|avg\.?|average|mittel(?:wert)?|mw|ø)(?=_|$)")
ASIDE = (
    r"(.*_)?(max|min|peak|std|sd|stdev|rms|range|pp|amplitude)(imum)?(_.*)?|(m|moment|torque|drehmoment)_?[xyz]?|f_?r(es)?|resultant(_force)?|"
    r"power|leistung|v_?c|cutting_speed|schnittgeschwindigkeit|mrr|ra"
)
"""Of a dynamometer's table, what no law is found from."""
PER_EDGE = ("feed_per_tooth", "c", "chip", "ft", "f_t", "f_z")


def above_zero(c: NamedTable, name: str, row: int, default: float = 0.0) -> float:
    """A number that must be above zero."""
    value = float(c.values[name][row]) if name in c.values else default
    if not value > 0:
        c.fail(f"expected a number above zero, found {value / c.size.get(name, 1.0):g}", name, row)
    return value


def _renamed(name: str, unit: str) -> tuple[str, str]:
    """A feed by its unit: ``fz`` is a force in N, and a feed per tooth in mm."""
    name = MEAN.sub("", name).strip("_") or name
    (length, per), is_feed = feed_unit(unit), re.fullmatch(SPELLED["feed"], name) is not None
    speed = length.endswith(("/min", "/s"))
    if (is_feed and not per and not speed) or (name == "feed_per_tooth" and (speed or per == "rev")):
        return name, f"{unit or 'none'}; a feed is in mm/tooth, mm/rev or mm/min"
    if name == "rpm":
        return name, unit or "rpm"
    if (is_feed and per) or (name == "fz" and length in ("mm", "um", "µm", "in")):
        return f"feed_per_{per or 'tooth'}", length
    return name, length if name in PER_EDGE else unit


KNOWN = Known(
    {n: WORD if n == "side" else si for n, (_, si) in COLUMNS.items()},
    {n: usual for n, (usual, _) in COLUMNS.items()},
    SPELLED,
    _renamed,
    aside=ASIDE,
    titled={*COLUMNS} - {"time", "fx", "fy", "fz", "side"},
)


def columns_of(table: ForceColumns, defaults: Mapping[str, object], sheet: str | None) -> NamedTable:
    """Numbers by the names of `COLUMNS`, SI, of a file or a mapping; `defaults`, SI, where it has none of that name. Raises FileError."""
    if isinstance(table, Mapping | DataFrame):
        out = named(_of_mapping(table), KNOWN)
    else:
        given_path(table, "table", "a file or a mapping of columns")
        out = read_named(table if sheet is None else TableFile(table, sheet=sheet), KNOWN)
    if "side" in out.values:
        out.values["side"] = np.array([_side(word) for word in out.values["side"]])
    way, *more = [n for n in ("feed", "feed_per_rev", NEEDED[0]) if n in out.values] or NEEDED[:1]
    if more:
        out.fail(f"expected one feed, found '{out.header[more[0]]}' and '{out.header[way]}'")
    for name, value in defaults.items():
        out.values.setdefault(name, np.full(len(out.lines), value))
    needed = (way, *(["spindle"] if way == "feed" else []), *NEEDED[1:])
    if missing := [COLUMNS[n][0] for n in needed if n not in out.values]:
        wanted = ", ".join(COLUMNS[n][0] for n in needed)
        place = "what is the same in all rows may stand in a line above them, as in teeth: 2, or in a process file"
        out.fail(f"missing column '{missing[0]}'; needed: {wanted}; {place}")
    if way != NEEDED[0]:
        names = (way, "teeth", *(["spindle"] if way == "feed" else []))
        feed, teeth, *spindle = np.array([[above_zero(out, n, i) for i in range(len(out))] for n in names])
        del out.values[way]
        out.values[NEEDED[0]] = (feed * 2 * pi / spindle[0] if spindle else feed) / teeth
        out.header[NEEDED[0]] = out.header[way]
    return out


def _side(word: str) -> str:
    bare = re.sub(r"[ _-]*(milling|cut(ting)?|fräsen)?$", "", word.strip().lower())
    return next((side for side, text in SIDE_WORDS.items() if re.fullmatch(text, bare)), word)


def _of_mapping(table: Mapping[Any, Any] | DataFrame) -> Table:
    """Rows counted from 1; single values stand for all rows."""
    columns = {str(k): [table[k]] if np.ndim(table[k]) == 0 else list(table[k]) for k in table}
    count = max((len(v) for v in columns.values()), default=0)
    for name, cells in columns.items():
        if len(cells) not in (1, count):
            raise FileError(f"expected {count} numbers or one, found {len(cells)}", file="table", key=name)
    full = [Cells.of(map(str, cells if len(cells) == count else cells * count)) for cells in columns.values()]
    return Table("table", tuple(columns), tuple(full), range(1, count + 1))


FORCES = ("fx", "fy", "fz")
SLOT_SIGNS = (-1.0, 1.0, 1.0)
"""Of the mean forces of a slot with positive coefficients."""
SAME = 2
"""Decimals of the logarithm of feeds per tooth that count as one feed, which is about 1 %."""

LONGEST_STEP, PART, IDLE = 3.0, 32, 0.1
"""Of a signal: its longest step in time, in usual ones; samples that show a cut; squares of forces without one, in usual squares."""


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

    def rows(self, chosen: NDArray[np.bool_]) -> ForceTable:
        """Some of the cuts."""
        index = np.arange(len(self.cuts))[chosen]
        return replace(self, cuts=tuple(self.cuts[i] for i in index), force=self.force[index], signals=())


def read_table(table: ForceColumns, process: Process | None = None, sheet: str | None = None) -> ForceTable:
    """A CSV file, a workbook, or a mapping (a data frame) of columns as `identify_process` takes them.

    Columns may be single values; `process` gives what no column says. With a column of time the rows are samples, and those
    of one cut become their mean over whole revolutions. Raises FileError naming file, line, column, expected and found.
    """
    c = columns_of(table, {} if process is None else _defaults(process), sheet)
    c.check("spindle", lambda v: v <= FASTEST / c.size.get("spindle", 1.0), "at most 1e6 rpm")
    force = np.stack([c.values[n] for n in FORCES], axis=1)
    if not force.any():
        c.fail("expected forces, found 0 N in every row", "fx")
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


def _whole_turns(c: NamedTable, here: NDArray[np.intp], force: Floats) -> Signals:
    time, turn = c.values["time"][here], 2 * pi / above_zero(c, "spindle", int(here[0]))
    steps = np.diff(time)
    step = float(np.median(steps)) if len(time) > 1 else 0.0
    for i in np.flatnonzero((steps <= 0) | (steps > LONGEST_STEP * abs(step)))[:1]:
        what = f"expected rising times in a cut, in even steps, found {time[i + 1]:g} s behind {time[i]:g} s"
        c.fail(what, "time", here[i + 1])
    turns = int((time[-1] - time[0] + step) / turn * (1 + 1e-9))
    if len(time) < 8 or turns < 1 or step > turn / 8:
        c.fail(
            f"expected a revolution ({turn:g} s) or more of each cut, with eight or more samples in each, found {len(time)} over "
            f"{time[-1] - time[0] + step:g} s", "time", here[0],
        )  # fmt: skip
    keep = min(len(time), round(turns * turn / step))
    cut = force[here[:keep]]
    parts = np.array_split(cut, max(1, min(turns, keep // PART)))
    quiet = min(parts, key=lambda f: float(np.ptp(f, axis=0).sum())).mean(axis=0)
    size = [np.mean((f - quiet) ** 2) for f in parts]
    if min(size) < IDLE * np.quantile(size, 0.9):
        at = ", ".join(f"{v:.3g}" for v in quiet)
        what = f"one that stays at Fx, Fy, Fz = {at} N and others that do not"
        way = "leave out the rows without a cut, and take their mean force off the others"
        c.fail(f"expected the same cut in every revolution, found {what}: {way}", "time", here[0])
    return Signals(time[:keep], cut)


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


def _defaults(process: Process) -> dict[str, object]:
    c, t = process.cut, process.tool
    return {
        "teeth": t.teeth, "axial": c.axial, "diameter": t.diameter, "radial": c.radial, "side": c.side,
        "spindle": process.spindle, "helix": t.helix,
    }  # fmt: skip


def _cut(c: NamedTable, i: int) -> Process:
    """One row's tool and engagement; its law is to be found."""
    way = str(c.values["side"][i]) if "side" in c.values else "slot"
    if way not in SIDES:
        c.fail(f"expected one of {', '.join(SIDES)}, found '{way}'", "side", i)
    if way != "slot" and not {"diameter", "radial"} <= set(c.values):
        c.fail("a cut that is no slot needs the columns diameter_mm and radial_mm")
    chip, axial, teeth = (above_zero(c, n, i) for n in ("feed_per_tooth", "axial", "teeth"))
    diameter, spindle = above_zero(c, "diameter", i, 0.01), above_zero(c, "spindle", i, 200 * pi)
    radial = diameter if way == "slot" else above_zero(c, "radial", i)
    if way == "slot" and "radial" in c.header and "side" not in c.header:  # a width, but on no side
        own = c.values["radial"][i]
        if "diameter" not in c.values or not isclose(own, diameter):
            what = f"a column side ({', '.join(SIDES)}) and diameter_mm next to a width"
            c.fail(f"expected {what}, found {1e3 * own:g} mm", "radial", i)
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
