"""Tables whose columns have known names, each with its unit, for all commands that take points, forces or frequencies.

``x [mm]``, ``x (mm)``, ``x in mm`` or ``x_mm``; order and case are free, a column of remarks, of names or of numbers of rows is left
out, and all that `read_sheet` understands is read: groups, units in a line of their own or in the cells, lines above the header.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError, StiffmapError, frames_of_this_package, suggestion
from stiffmap.common.number_text import read_value
from stiffmap.common.short import first_of
from stiffmap.common.tables.header import IN_SI, meaning_of, split_unit, with_unit
from stiffmap.common.tables.lines import Spelling, is_finite
from stiffmap.common.tables.orientation import spread
from stiffmap.common.tables.sheet import read_sheet
from stiffmap.common.tables.table import Table
from stiffmap.common.tables.table_file import layout_of, table_file, with_names, with_units
from stiffmap.common.tables.titles import said_in, with_said
from stiffmap.common.units import FREQUENCIES, QUANTITIES, SHORT_TIMES, feed_unit, unit_of

SPELLED = {"s": SHORT_TIMES, "percent": {"%": 1.0, "-": 100.0, "1": 100.0}}
"""SI unit -> others that tables of such columns have."""
PER = re.compile(r"_(?:per_)?(min|s|tooth|rev)$")
COUNTER = re.compile(
    r"(?i)column \d+|unnamed: ?\d+|(index|idx|line|sample|frame|record|pose|serial|n|test|run|cut|trial|exp(eriment)?|versuch|measurement)"
    r"( ?(no|nr|number|id))?\.?"
)
"""Names of columns that may number the rows, or groups of them; programs leave out the name, or write ``Unnamed: 0``."""
ASIDE = re.compile(
    r"(?i)time ?stamp|date|mac|mpc|coh(erence)?|(actual|target)_(q|qd|qdd|current|moment|tcp_\w+)_\d|(joint|q|j)[ _]?[1-9]|"
    r"(robot|safety|joint)_(mode|status)(_\w+)?|runtime_state|speed_scaling"
)
"""Names of columns that programs write next to what a table is for; they are left out with a word."""
WORD = "word"
"""In place of a unit: the column holds text."""


@dataclass(frozen=True)
class Known:
    """Names that a table may have."""

    units: Mapping[str, str]
    """Name -> SI unit; empty for a plain number, `WORD` for text."""
    usual: Mapping[str, str]
    """Name -> how a table usually writes it."""
    spelled: Mapping[str, str]
    """Name -> regular expression of other spellings, blanks as underscores."""
    renamed: Callable[[str, str], tuple[str, str]] = lambda name, unit: (name, unit)
    """Name and unit of a column whose unit decides what it is."""
    assumed: Mapping[str, str] | None = None
    """Name -> unit of a column that names none; None: it must."""
    blank: bool = False
    """Whether cells may be empty, which are NaN then."""
    options: bool = True
    """Whether the command has --map, --unit, --header and --table."""
    aside: str = ""
    """Regular expression of names that are left out with a word: what such tables have next to what is read."""
    titled: Collection[str] = ()
    """Names that a title above rows may say of them."""
    stacked: Collection[str] = ()
    """Names that may stand side by side with numbers behind them, ``f1``, ``f2``, of which each is a row."""

    def named(self, name: str) -> str:
        """The name of a column by one of its spellings; the name itself where it is none."""
        joined = _joined(name)
        if joined in self.units:
            return joined
        return next((n for n, other in self.spelled.items() if re.fullmatch(other, joined)), joined)

    def has(self, name: str) -> bool:
        """Whether a table may have a column of this name, without its unit."""
        return self.named(name) in self.units

    def name_of(self, head: str) -> tuple[str, str]:
        """What a column is, its own name where it is nothing known, and its unit as written."""
        text, unit = split_unit(head)
        name, meant = _joined(text), meaning_of(text)
        if not self.has(text) and meant not in self.units and not re.search(r"[])]\s*$", head):
            whole = re.sub(r"\s", "_", head)  # x_per_tooth_mm, real_m/N
            parts = {m.start(): whole[: m.start()].lower() for m in re.finditer("_", whole)}
            cuts = [k for k, part in parts.items() if self.has(part) or self.has(self.renamed(part, "")[0])]
            if cuts:
                name, unit = whole[: cuts[-1]].lower(), PER.sub(r"/\1", whole[cuts[-1] + 1 :])
                unit = {"N_m": "N*m"}.get(unit, unit)
        name, unit = self.renamed(name, unit)
        meant = meant or meaning_of(name.replace("_", " "))
        name = self.named(name)
        return meant if name not in self.units and meant in self.units else name, unit


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

    def __len__(self) -> int:
        return len(self.lines)

    def fail(self, message: str, name: str = "", row: int | None = None) -> NoReturn:
        """Raise FileError at a column and, where one is given, a row."""
        line = self.first or None if row is None else self.lines[row]
        raise FileError(message, file=self.file, line=line, key=self.header.get(name, name))

    def block(self, names: Sequence[str], missing: float = 0.0) -> Floats:
        """(n, names); `missing` where there is no column."""
        return np.stack([self.values.get(c, np.full(len(self), missing)) for c in names], axis=1)

    def check(self, name: str, good: Callable[[Floats], object], expected: str) -> None:
        """FileError at the first row whose number, in the unit of the table, is not good; where there is none, it is."""
        value = np.asarray(self.values.get(name, ())) / self.size.get(name, 1.0)
        wrong = np.flatnonzero(~np.asarray(good(value)) & ~np.isnan(value))
        if wrong.size:
            self.fail(f"expected {expected}, found {value[wrong[0]]:.12g}", name, int(wrong[0]))


def read_named(place: str | PathLike[str], known: Known) -> NamedTable:
    """A text or a workbook, or a `TableFile`. Raises FileError naming file, line and column, what was expected and what was found."""
    return named(known_sheet(place, known), known)


def known_sheet(place: str | PathLike[str], known: Known, *, repeated: bool = False) -> Table:
    """The table of a text, a workbook or a `TableFile`, with what titles say of its rows, and its columns named and in units as they are
    said; `repeated`: whether names may come again. Raises FileError, also for a remark between the rows."""
    file = table_file(place)
    names = ", ".join(known.usual.get(n, n) for n in known.units)
    layout = layout_of(file, known.has, strict=True, repeated=repeated, names=names, options=known.options)
    table = _titled(read_sheet(Path(file), file.sheet, layout), known, file.columns)
    replace(table, aside=()).refuse_remarks()
    table = _stacked(table, known) if known.stacked else table

    def meaning(header: str) -> tuple[str, str, str]:
        name, unit = known.name_of(header)
        return name, unit, QUANTITIES.get(known.units.get(name, ""), "")

    if {*"xyz"} <= {*known.units} and not {*"xyz"} & {meaning(h)[0] for h in table.header}:
        table = spread(table)
    return with_units(file, with_names(file, table, lambda h: meaning(h)[0]), meaning)


def _titled(table: Table, known: Known, chosen: Collection[str]) -> Table:
    """With columns of what titles say that the table has no column of, in a unit of that quantity."""
    has = {known.name_of(h)[0] for h in table.header} | {*chosen}
    said = said_in(
        table,
        lambda n: known.has(n) or known.has(known.renamed(n, "")[0]),
        counted=lambda n: known.units.get(known.named(n)) == "",
    )
    names = {key: known.name_of(with_unit(*key)) for key in said}
    good = {
        key: said[key]
        for key, (name, unit) in names.items()
        if name in known.titled and name not in has and _has_dimension(unit, known.units[name])
    }
    table, words = with_said(table, good, lambda *_: True, lambda n: known.name_of(n)[0] in "xyz")
    if words:
        warnings.warn(f"{table.file}: {'; '.join(words)}", stacklevel=frames_of_this_package())
    return table


def _has_dimension(unit: str, si: str) -> bool:
    try:
        return not unit if si == "" else si != WORD and bool(unit) and size_in(unit, si) > 0
    except StiffmapError:
        return False


def _stacked(table: Table, known: Known) -> Table:
    """``f1``, ``f2``, ``D1``, ``D2`` as two rows of ``f`` and ``D``, but not where a name without a number stands next to them."""
    found: dict[str, dict[int, int]] = {}
    for i, name in enumerate(table.names):
        if match := re.fullmatch(r"(.*?)[ _]*(\d{1,2})", name):
            base = with_unit(match[1], table.unit(i))
            if known.name_of(base)[0] in known.stacked:
                found.setdefault(base, {})[int(match[2])] = i
    every = sorted({k for of in found.values() for k in of})
    if len(every) < 2 or any(base in table.header for base in found):
        return table
    taken = {i for of in found.values() for i in of.values()}
    kept = [i for i in range(len(table.header)) if i not in taken]
    tall = replace(
        table, header=tuple(table.header[i] for i in kept), columns=tuple(table.columns[i] for i in kept)
    )
    tall = tall.repeated(len(every))
    for base, of in found.items():
        cells = (table.columns[of[k]] if k in of else [""] * len(table) for k in every)
        tall = tall.with_cells(base, (c for row in zip(*cells, strict=True) for c in row))
    return tall


def sets_of(path: Path, known: Known, shared: str) -> list[NamedTable]:
    """A text or a workbook whose names come again, but a `shared` one: the first of each, the second of each, … Raises FileError."""
    sheet = known_sheet(path, known, repeated=True)
    out, left = list[NamedTable](), {*range(len(sheet.header))}
    while left or not out:
        again: list[int] = []
        out.append(named(sheet, known, {*range(len(sheet.header))} - left, again))
        for part in ("header", "units", "size", "values"):
            of, first = getattr(out[-1], part), getattr(out[0], part)
            of.update({shared: first[shared]} if shared in first and shared not in of else {})
        left = {*again}
    return out


def named(
    sheet: Table, known: Known, besides: Collection[int] = (), again: list[int] | None = None
) -> NamedTable:
    """Columns of a sheet, but some, by their known names; raises FileError, also for a second one of a name where there is no `again`,
    which takes them."""
    out, left = NamedTable(sheet.file, list(sheet.lines), sheet.top, {}, {}, {}, {}), [*sheet.aside]
    for i, (head, text) in enumerate(zip(sheet.header, sheet.names, strict=True)):
        meant = meaning_of(text)
        if i in besides or (not known.has(text) and (meant == "id" or _counts(sheet, i))):
            continue
        said = meant not in known.units and ASIDE.fullmatch(text) is not None
        if known.aside and known.name_of(head)[0] not in known.units:
            said = said or re.fullmatch(known.aside, _joined(text)) is not None
        if not known.has(text) and (said or meant == "temperature") and sheet.is_numeric(i):
            left.append(head)
            continue
        name, unit, size = _meaning(sheet, i, known, out)
        if not name:
            continue
        if name in out.header and again is not None:
            again.append(i)
            continue
        if name in out.header:
            out.fail(f"a column is given twice, as '{out.header[name]}' and '{head}'")
        out.header[name], out.units[name], out.size[name] = head, unit, size
        words = known.units[name] == WORD
        out.values[name] = list(sheet.columns[i]) if words else size * sheet.numbers(i, blank=known.blank)
    if left:
        warnings.warn(f"{sheet.file}: left out: {first_of(left)}", stacklevel=frames_of_this_package())
    return out


def _counts(sheet: Table, column: int) -> bool:
    """Whether a column numbers the rows, or groups of them, or gives them names."""
    if not COUNTER.fullmatch(sheet.names[column]):
        return False
    return not sheet.is_numeric(column) or bool(np.isin(np.diff(sheet.numbers(column)), (0.0, 1.0)).all())


def _joined(name: str) -> str:
    return re.sub(r"\s+", "_", name.lower())


def _meaning(sheet: Table, column: int, known: Known, table: NamedTable) -> tuple[str, str, float]:
    """Name of a column, nothing where no cell is a number, its unit as written, and the SI size of that."""
    head = sheet.header[column]
    name, unit = known.name_of(head)
    usual = known.usual.get(name, name)
    if name not in known.units:
        spelling = Spelling(sheet.decimal_comma)
        if not suggestion(name, known.units) and not any(
            is_finite(c, spelling) for c in sheet.columns[column]
        ):
            return "", "", 1.0
        shown = ", ".join(known.usual.get(n, n) for n in known.units)
        way = f"; say what it is, as in --map x='{head}', or leave it out: --map note='{head}'"
        what = f"unknown column '{head}'; known: {shown}, each with its unit, as in x [mm] or x_mm"
        table.fail(what + way if known.options else what)
    si = known.units[name]
    if si in ("", WORD):
        return name, unit, 1.0
    if not unit:
        unit = si if IN_SI.fullmatch(sheet.names[column]) else (known.assumed or {}).get(name, "")
    if not unit:
        way = f" or say --unit {name}={known.name_of(usual)[1]}" if known.options else ""
        table.fail(
            f"the unit is missing: write {usual}{way}; expected a unit such as in {usual}, found none", head
        )
    try:
        return name, unit, size_in(unit, si)
    except StiffmapError:
        table.fail(f"expected a unit such as in {usual}, found {unit}", head)


def size_in(unit: str, si: str) -> float:
    """SI size of a unit that has the dimension of `si`, as experiments, effects and workshops write it; StiffmapError."""
    if si in ("rad/s", "Hz") and unit.lower() in FREQUENCIES:
        return FREQUENCIES[unit.lower()] * (1.0 if si == "Hz" else 2 * math.pi)
    unit = feed_unit(unit)[0] if si == "m/s" else unit
    if unit == si:
        return 1.0
    if unit in SPELLED.get(si, ()):
        return SPELLED[si][unit]
    spelled = unit_of(unit, QUANTITIES[si]) if si in QUANTITIES else None
    try:
        return read_value(f"1 {unit}", si)
    except StiffmapError:
        if spelled is None or spelled.mass:
            raise
        return spelled.size
