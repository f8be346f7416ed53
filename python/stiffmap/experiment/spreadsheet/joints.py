"""Tables whose rows are commanded joints: which column is which drive, and what an instrument read with them."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.common.tables.header import split_unit
from stiffmap.common.tables.sheet import Sheet
from stiffmap.common.units import Unit, unit_of
from stiffmap.experiment.spreadsheet.guess import SEEN, Column, find_column, guess
from stiffmap.experiment.spreadsheet.instrument import with_column
from stiffmap.solve.machine import Machine

NUMBERED = r"(joint|axis|achse|gelenk|theta|q|j|a)[ _.-]?{}"
MOST_TURNS = 4.0 * math.pi
"""Of a joint; larger numbers are degrees."""
DIFFERENCES = ("actual-minus-target", "target-minus-actual")


@dataclass(frozen=True)
class Commanded:
    """A sheet with commanded joints, as `understand` takes it."""

    sheet: Sheet
    columns: dict[str, tuple[str, str]]
    """Column of data.csv -> full name of the drive, unit."""
    chosen: dict[str, list[str]]
    """Meaning -> headers, the drives' columns among them."""
    head: dict[str, Any] = field(default_factory=dict)
    """Further keys of experiment.yaml."""
    told: tuple[str, ...] = ()
    """What the reader must know, in words."""

    def coordinates(self) -> Floats:
        """(n, drives) commanded coordinates, m and rad."""
        out = []
        for meaning, (_, unit) in self.columns.items():
            header = self.chosen[meaning][0]
            out.append(Unit(unit).size * self.sheet.numbers(self.sheet.header.index(header)))
        return np.column_stack(out)

    def middle(self) -> Floats:
        """(drives,) the row that is nearest to the middle of all."""
        at = self.coordinates()
        return np.asarray(at[np.nanargmin(np.linalg.norm(at - np.nanmedian(at, axis=0), axis=1))])


def drives_of(machine: Machine) -> dict[str, bool]:
    """Drives of a machine by full name, and whether each slides."""
    return {a: machine.compiled.names.is_prismatic(a) for a in machine.actuators}


def commanded(
    sheet: Sheet,
    drives: Mapping[str, bool],
    chosen: Mapping[str, list[str]],
    units: Mapping[str, str],
) -> Commanded | None:
    """The sheet as a table of joints; None where no column commands a drive.

    `drives`: full name -> whether it slides. Columns go by the drive's name, full or short, or by its number (`joint_1`, `q1`,
    `J1`, `A1`), or as `chosen` says. Raises StiffmapError where some drives have a column and others none, and where a unit is
    missing.
    """
    given = _given(chosen, drives)
    at = {name: _find(sheet, name, k, given.get(name)) for k, name in enumerate(drives, 1)}
    lost = [n for n, i in at.items() if i is None]
    if len(lost) == len(at):
        return None
    if lost:
        there = ", ".join(f"'{h}'" for h in sheet.header)
        raise StiffmapError(
            f"{sheet.file}: which column commands {lost[0]}? Say --map {lost[0]}='HEADER'; columns: {there}"
        )
    rest = {
        k: v for k, v in chosen.items() if k not in drives and k not in {n.split(".")[-1] for n in drives}
    }
    columns, told = {}, []
    for k, (name, slides) in enumerate(drives.items(), 1):
        index = at[name]
        assert index is not None
        unit, why = _unit(sheet, index, name, slides, units)
        told += [why] if why else []
        columns[f"q{k}"] = (name, unit)
        rest[f"q{k}"] = [sheet.header[index]]
    return Commanded(sheet, columns, rest, told=tuple(told))


def _given(chosen: Mapping[str, list[str]], drives: Mapping[str, bool]) -> dict[str, str]:
    out = {}
    for name in drives:
        for key in (name, name.split(".")[-1]):
            if key in chosen:
                out[name] = chosen[key][0]
    known = {*drives, *(n.split(".")[-1] for n in drives)}
    wrong = [k for k in chosen if "." in k and k not in known]
    if wrong:
        raise StiffmapError(f"--map: no drive '{wrong[0]}'; there are: {', '.join(drives)}")
    return out


def _find(sheet: Sheet, name: str, number: int, header: str | None) -> int | None:
    names = [split_unit(h)[0].strip().lower() for h in sheet.header]
    if header is not None:
        return find_column(header, sheet.header)
    for wanted in (name.lower(), name.split(".")[-1].lower()):
        if wanted in names and wanted not in ("x", "y", "z"):
            return names.index(wanted)
    pattern = NUMBERED.format(number)
    return next((i for i, n in enumerate(names) if re.fullmatch(pattern, n)), None)


def _unit(sheet: Sheet, index: int, name: str, slides: bool, units: Mapping[str, str]) -> tuple[str, str]:
    header, written = split_unit(sheet.header[index])
    said = next(
        (units[k] for k in (name, name.split(".")[-1], header, "joints") if k in units),
        written or units.get("length" if slides else "angle", ""),
    )
    unit = unit_of(said, "length" if slides else "angle") if said else None
    if unit is not None and unit.factor == 1.0:
        return unit.name, ""
    largest = float(np.nanmax(np.abs(sheet.numbers(index)), initial=0.0))
    if not said and not slides and largest > MOST_TURNS:
        return "deg", f"'{sheet.header[index]}' goes to {largest:.4g}: taken as degrees"
    kind = "mm" if slides else "deg"
    raise StiffmapError(
        f"column '{sheet.header[index]}' ({name}) has no unit of {'lengths' if slides else 'angles'}: write it in the header, "
        f"as in '{header} [{kind}]', or say --unit joints={kind}"
    )


def as_seen(c: Commanded, units: Mapping[str, str], difference: str) -> Commanded:
    """What was read as places in the instrument's own frame, where the table has them: frame, and place of the reflector on the
    tool, are then unknown.

    Places are columns `px py pz`, or targets and differences side by side; `x y z` alone with joints are asked for.
    """
    columns = guess(c.sheet.header, c.chosen)
    of = {k.meaning: k for k in columns if k.repeat == 0}
    unknown = {"frame": "unknown", "tool": "unknown"}
    if any(s in of for s in SEEN):
        sheet, chosen = c.sheet, dict(c.chosen)
        for s in SEEN:
            if s in of:
                sheet, chosen = _in_mm(sheet, chosen, s, [(1.0, of[s])], units)
        return Commanded(sheet, c.columns, chosen, unknown, c.told)
    if "ll" in of:  # a wire's end sits somewhere on the tool; x y z are the controller's
        return replace(c, head={"tool": "offset_unknown"})
    if not all(a in of for a in "xyz"):
        return c
    if not all(f"d{a}" in of for a in "xyz"):
        raise StiffmapError(
            f"{c.sheet.file}: {', '.join(repr(of[a].name) for a in 'xyz')} with commanded joints: if an instrument read them, say "
            f"--map px='{of['x'].name}' --map py='{of['y'].name}' --map pz='{of['z'].name}'"
        )
    sign = 1.0 if difference == DIFFERENCES[0] else -1.0
    sheet, chosen = c.sheet, dict(c.chosen)
    for a in "xyz":
        sheet, chosen = _in_mm(sheet, chosen, f"p{a}", [(1.0, of[a]), (sign, of[f"d{a}"])], units)
        chosen["note"] = [
            *chosen.get("note", ()),
            c.sheet.header[of[a].index],
            c.sheet.header[of[f"d{a}"].index],
        ]
    told = f"places are targets {'plus' if sign > 0 else 'less'} differences ({difference}); their frame, and the reflector's place, are unknown"
    return Commanded(sheet, c.columns, chosen, unknown, (*c.told, told))


def turned(sheet: Sheet, columns: Sequence[Column], difference: str) -> tuple[Sheet, dict[str, list[str]]]:
    """The sheet with readings as actual minus target, and the columns that have them; nothing where they are that already."""
    if difference == DIFFERENCES[0]:
        return sheet, {}
    chosen: dict[str, list[str]] = {}
    for c in columns:
        if c.meaning in ("dx", "dy", "dz", "rx", "ry", "rz", "dd"):
            unit = f" [{c.unit}]" if c.unit else ""
            name = f"less {c.name}{unit}"
            sheet = with_column(sheet, name, [-v for v in sheet.numbers(c.index)])
            chosen.setdefault(c.meaning, []).append(name)
    return sheet, chosen


def _in_mm(
    sheet: Sheet,
    chosen: dict[str, list[str]],
    meaning: str,
    parts: Sequence[tuple[float, Column]],
    units: Mapping[str, str],
) -> tuple[Sheet, dict[str, list[str]]]:
    total = np.zeros(len(sheet.lines))
    for sign, column in parts:
        said = units.get(column.meaning, column.unit) or units.get("length", "")
        size = sheet.size(column.index, column.meaning, "length", said)
        total = total + sign * 1e3 * size * sheet.numbers(column.index)
    name = f"{meaning} [mm]"
    if name not in sheet.header:
        sheet = with_column(sheet, name, [float(v) for v in total])
    return sheet, chosen | {meaning: [name]}
