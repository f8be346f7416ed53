"""A sheet to an experiment folder: experiment.yaml, data.csv, notes.csv."""

from __future__ import annotations

import re
from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, islice, repeat
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.common.outputs import make_folder, only_job, write_rows, write_text
from stiffmap.common.tables.cells import BLOCK
from stiffmap.common.tables.table import Table
from stiffmap.common.units import unit_of
from stiffmap.common.yaml_text import text_of
from stiffmap.experiment.channels import AXES
from stiffmap.experiment.experiment import WRENCH
from stiffmap.experiment.files.fields import POSE, quantity_of
from stiffmap.experiment.spreadsheet.answers import Meant
from stiffmap.experiment.spreadsheet.guess import READINGS, Column, guessed, named_loads
from stiffmap.experiment.spreadsheet.instrument import load_instrument
from stiffmap.experiment.spreadsheet.sides import side_of_run
from stiffmap.experiment.spreadsheet.together import weight

WORDS = ("id", "setup", "branch", "target")
"""Columns of words that a sheet may have."""
Numbers = Mapping[str, float]
RATIO = re.compile(r"N/\s?[mµu]?m\b|\b[mµu]?m/k?N\b")
"""Units of stiffness and compliance."""
RARE = 0.03
"""How seldom readings are by chance as near to the mean of others as one that is computed."""
ABSOLUTE = {"ll": "length"}
"""Readings that a sheet has in coordinates of their own -> their columns in data.csv."""


@dataclass(frozen=True)
class ImportedSheet:
    """What was understood of a sheet."""

    columns: list[Column]
    units: dict[str, str]
    factors: dict[str, float]
    """Of columns in units that experiment files do not have: how many of `units` one of the sheet's is."""
    rows: Rows
    constants: dict[str, float]
    said: list[str]
    """What the reader must know, in words."""


def understand(m: Meant, loaded: bool = False) -> ImportedSheet:
    """Columns, units and rows of data.csv of a sheet, as it is meant; raises StiffmapError that asks for what cannot be guessed.

    ``loaded``: whether a load must be there.
    """
    sheet, drives = m.sheet, m.columns
    columns = m.guessed
    used = [c for c in columns if c.meaning != "note"]
    for c in used:
        if c.meaning not in WORDS:
            sheet.numbers(c.index)  # raises, naming the line
    for c in (c for c in used if c.meaning in m.constants):
        way = f"--set {c.meaning}: column '{c.name}' says it row by row; leave one of the two out"
        raise StiffmapError(f"{sheet.file}: {way}")
    known = {c.meaning for c in used} | set(m.constants)
    if drives:  # the pose follows from them
        columns = [replace(c, meaning="note") if c.meaning in POSE else c for c in columns]
        used = [c for c in columns if c.meaning != "note"]
        known |= set(POSE)
    _ask(m, known, bool(drives))
    for meaning in dict.fromkeys(c.meaning for c in used if c.repeat):
        _refuse_loads(m, [c for c in used if c.meaning == meaning])
    both = ([c, k] for c in used for k in columns if k.meaning == "note" and guessed(k.name) == c.meaning)
    for c, k in both:  # one of which would go to the notes in silence
        if (of := c.meaning) in (*AXES, *WRENCH) and of not in m.chosen and sheet.is_numeric(k.index):
            own, other = m.metres([c.index, k.index], [of] * 2).T
            if np.nanmax(np.abs(own - other), initial=0.0) > 0.01 * np.nanmax(np.abs(own), initial=0.0):
                two, way = f"'{c.name}' and '{k.name}'", f"--map {of}='HEADER', or 'HEADER|HEADER' of repeats"
                m.ask_column(f"which of {two} is {of}? Say {way}", "reading" if of in AXES else "load")
    units = dict.fromkeys((c.meaning, m.unit(c.index, c.meaning)) for c in used if quantity_of(c.meaning))
    found = dict(list(units))
    for meaning in (name for name, unit in units if unit != found[name]):
        written = " and ".join(f"'{sheet.header[c.index]}'" for c in used if c.meaning == meaning)
        raise StiffmapError(f"{sheet.file}: expected one unit of all repeats of {meaning}; found {written}")
    for axis in sorted({*WRENCH} - known) if loaded else ():
        if headers := ", ".join(f"'{sheet.header[c.index]}'" for c in named_loads(columns, axis)):
            m.ask_column(
                f"which of {headers} is {axis}? Say --map {axis}='HEADER', or --set {axis}=0", "load"
            )
    if loaded and not known & {*WRENCH, "ll"}:
        m.ask_column(
            "missing column: a deflection needs a load; which column is it? Say --map fx='HEADER' (fy, fz, mx, my, mz; "
            "--map fz='-HEADER' where it pulls against the axis), or --set fx=NUMBER (N) where it is the same in every row",
            "load",
        )
    mean = _is_mean(sheet, [c for c in used if c.meaning not in WORDS])
    said = [f"left out: row {sheet.lines[-1]} is the mean of those above it in every number"] if mean else []
    for quantity in sorted({quantity_of(c.meaning) or "" for c in used if not c.unit} - {"", *m.units}):
        if text := m.usual_unit(quantity):
            said.append(
                f"{quantity} is in '{text}', as a line above the table says, where a column names no unit"
            )
    for c in used:
        if c.meaning in WRENCH[:3]:
            sign, why = weight(sheet, c.index, c.name[:1] in ("+", "-"), c.meaning, found[c.meaning])
            found[c.meaning] = found[c.meaning]._replace(factor=sign * found[c.meaning].factor)
            said += [why] if why else []
    named = {m: u.name for m, u in found.items()}
    factors = {m: u.factor for m, u in found.items() if u.factor != 1.0}
    rows = Rows(sheet, used, m.constants, factors, len(sheet) - mean)
    return ImportedSheet(columns, named, factors, rows, dict(m.constants), said)


def _is_mean(sheet: Table, columns: Sequence[Column]) -> bool:
    """Whether the last row is the mean of three or more, to the digits that it has and by more than chance; not where a command that
    varies comes again in it: readings in proportion to loads up and down have their own mean."""
    chance = 1.0
    for c in columns if len(sheet) > 3 else ():
        values = sheet.numbers(c.index)
        last, above = values[-1], values[:-1][np.isfinite(values[:-1])]
        decimals = sheet.columns[c.index].last.replace(",", ".").partition(".")[2]
        step = max(0.1 ** len(decimals), 1e-9 * np.max(np.abs(above), initial=0.0))
        if len(above) < 3 or not abs(last - above.mean()) <= 0.501 * step:
            return False
        if (spread := np.ptp(above)) and c.meaning in READINGS:
            chance *= min(1.0, step / spread)
        elif spread and last in above:
            return False
    return bool(chance < RARE)


def _refuse_loads(m: Meant, repeats: Sequence[Column]) -> None:
    """StiffmapError where columns side by side are not numbered from 1, or have units of something else: each has a load of its own."""
    ordered = sorted(c.repeat for c in repeats) == [*range(1, len(repeats) + 1)]
    if not ordered or any(unit_of(c.unit) and not unit_of(c.unit, quantity_of(c.meaning)) for c in repeats):
        headers = ", ".join(f"'{m.sheet.header[c.index]}'" for c in repeats)
        raise StiffmapError(
            f"{m.sheet.file}: {headers} are no repeats, numbered from 1 in units of {repeats[0].meaning}: of several loads, write a "
            f"row for each one with the load in a column; of one, say --map {repeats[0].meaning}='HEADER|HEADER'"
        )


def _ask(m: Meant, known_: set[str], joints: bool) -> None:
    lost = [a for a in POSE if a not in known_]
    if lost:
        m.ask_column(
            f"which column is the position {lost[0]}? Say --map {lost[0]}='HEADER', or "
            f"--set {lost[0]}=NUMBER (mm) where it is the same in every row; of commanded joints, --map JOINT='HEADER'",
            lost[0],
        )
    if not known_ & set(READINGS):
        places = "--map px='HEADER' (py, pz) for measured positions; of differences " if joints else ""
        asked = [c.index for c in m.guessed if c.meaning in POSE]
        patterns = () if joints else load_instrument("tracker").measured.values()
        seen = (i for p in patterns if (i := m.sheet.find(p, asked)) is not None)
        names = [n for i in seen if (n := m.sheet.names[i]).lower() not in POSE]
        if {1.0, -1.0} <= {*map(side_of_run, runs := [h for h in m.sheet.header if side_of_run(h)])}:
            m.ask_column(
                f"which column is a reading? Of runs in both directions, say --map dx='{'|'.join(runs)}' (dy, dz)",
                "reading",
            )
        made = [h for i, h in enumerate(m.sheet.header) if RATIO.search(m.sheet.unit(i))]
        of = f" '{made[0]}' is computed: expected the load and the deflection." if made else ""
        if names:
            places = f"--instrument tracker, which takes the command off '{names[0]}'; of differences "
        m.ask_column(
            f"which column is a reading?{of} Say {places}--map dx='HEADER' (dy, dz, rx, ry, rz), several headers with | between them for "
            "repeats, or length='HEADER'; where a ball stood in one socket, --set px=0 --set py=0 --set pz=0",
            "reading",
        )


class Rows:
    """Rows of data.csv, made one by one whenever they are asked for: text, and numbers as floats."""

    def __init__(
        self, sheet: Table, used: list[Column], constants: Numbers, factors: Numbers, count: int
    ) -> None:
        self._sheet, self._count = sheet, count
        self.repeats = max([c.repeat for c in used], default=0) or 1
        """Side by side in the sheet, which become rows one below the other."""
        common = [c for c in used if c.repeat == 0]
        meanings = list(dict.fromkeys(c.meaning for c in used if c.repeat))
        header = [*(c.meaning for c in common), *constants, *meanings]
        self.header = [*header, *(["repeat"] if self.repeats > 1 else [])]
        self._numbers = {c.index: sheet.numbers(c.index) for c in used if c.meaning not in WORDS}
        for c in used:
            if c.meaning in factors:
                self._numbers[c.index] = self._numbers[c.index] * factors[c.meaning] + 0.0  # no -0
        at = {(c.meaning, c.repeat): c.index for c in used}
        always = [*(c.index for c in common), *map(float, constants.values())]
        self._wanted: list[list[int | float | None]] = [
            [*always, *(at.get((m, k)) for m in meanings)] for k in range(1, self.repeats + 1)
        ]
        self._name = header.index("id") if "id" in header else None
        self.lines = array("q")
        """Line in the sheet of each row, once they were made."""
        self._read = itemgetter(*(header.index(m) for m in READINGS if m in header))
        self._unread = self._read([""] * len(header))

    def __iter__(self) -> Iterator[Sequence[object]]:
        self.lines = array("q")
        taken: set[str] = set()
        sides = zip(*map(self._side, range(self.repeats)), strict=True)
        for line, rows in islice(zip(self._sheet.lines, sides, strict=True), self._count):
            for row in rows:
                if self._read(row) != self._unread:
                    self.lines.append(line)
                    yield self._once(row, taken)

    def _once(self, row: Sequence[object], taken: set[str]) -> Sequence[object]:
        """A point that is read again is a repeat: its second row is called ``P1.2``."""
        if self._name is None:
            return row
        name = str(row[self._name]) or "row"
        free, count = name, 1
        while free in taken:
            count += 1
            free = f"{name}.{count}"
        taken.add(free)
        return row if free == row[self._name] else [*row[: self._name], free, *row[self._name + 1 :]]

    def _side(self, k: int) -> Iterator[Sequence[object]]:
        """Rows of one of the repeats that stand side by side."""
        columns = [self._cells(wanted) for wanted in self._wanted[k]]
        if self.repeats > 1:
            if self._name is not None:
                columns[self._name] = (f"{name}.{k + 1}" for name in columns[self._name])
            columns.append(self._same(k + 1))
        return zip(*columns, strict=True)

    def _cells(self, wanted: int | float | None) -> Iterable[object]:
        """Of a column of the sheet by its index, or of a number that is the same in all rows; None: empty ones."""
        if wanted is None or isinstance(wanted, float):
            return self._same("" if wanted is None else wanted)
        if wanted not in self._numbers:
            return self._sheet.columns[wanted]
        blocks = (self._numbers[wanted][i : i + BLOCK].tolist() for i in range(0, len(self._sheet), BLOCK))
        return ("" if v != v else v for v in chain.from_iterable(blocks))

    def _same(self, cell: object) -> Iterable[object]:
        return repeat(cell, len(self._sheet.lines))


def write_folder(
    found: ImportedSheet,
    m: Meant,
    folder: Path,
    machine: str,
    quantity: str,
    title: str,
    record: Mapping[str, str] | None = None,
) -> None:
    """Write the folder; raises FileError where it cannot be written."""
    sheet = m.sheet
    head: dict[str, Any] = {"title": title, "machine": machine, "quantity": quantity}
    head["units"] = head_units(found, sheet.file)
    if m.noise:
        factors = {n.replace("p", "d"): f for n, f in found.factors.items()}
        own = {absolute: n for n, absolute in ABSOLUTE.items()}
        if set(AXES[3:]) & set(m.noise) - set(found.units):
            head["units"].setdefault("angle", m.usual_unit("angle") or "deg")
        head["noise"] = {own.get(n, n): v * factors.get(own.get(n, n), 1.0) for n, v in m.noise.items()}
    if m.columns:
        head["command"] = {k: {"actuator": a, "unit": u} for k, (a, u) in m.columns.items()}
    head |= m.head
    told = {**dict(sheet.record), **(record or {})}
    if "notes" in told:
        head["notes"] = told.pop("notes")
    if told:
        head["record"] = told
    with only_job(make_folder(folder)):
        header = [ABSOLUTE.get(h, h) for h in found.rows.header]
        head["rows"] = write_rows(folder / "data.csv", header, found.rows)
        if not head["rows"]:
            read = ", ".join(f"'{c.name}'" for c in found.columns if c.meaning in READINGS)
            raise StiffmapError(f"{sheet.file}: no row has a reading: no number in {read}")
        notes = [c.index for c in found.columns if c.meaning == "note"]
        if notes:
            kept = zip(*(sheet.columns[i] for i in notes), strict=True)
            write_rows(folder / "notes.csv", [sheet.header[i] for i in notes], kept)
        write_text(folder / "experiment.yaml", text_of(head))


def head_units(found: ImportedSheet, file: str) -> dict[str, str]:
    """Units for experiment.yaml: mm and N in common, every column that differs by its name."""
    common = {"length": "mm", "force": "N"}
    out = dict(common)
    for meaning, unit in found.units.items():
        base = meaning.removeprefix("u_")
        if meaning == "temperature":
            out["temperature"] = unit
        elif meaning.startswith(("euler", "pr")):
            out["angle"] = unit
        elif meaning.startswith("u_"):
            if found.units.get(base) != unit:
                raise StiffmapError(
                    f"{file}: columns {base} and {meaning} need the same unit; found {found.units.get(base)} and {unit}"
                )
        elif unit not in common.values():
            out[meaning] = unit
    return out
