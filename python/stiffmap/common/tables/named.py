"""Tables whose columns have known names, each with its unit, for all commands that take points, forces or frequencies; tables of poses
among them, one convention for all commands.

``x [mm]``, ``x (mm)``, ``x in mm`` or ``x_mm``; order and case are free, a column of remarks, of names or of numbers of rows is left out, and all that
`read_sheet` understands is read: groups, units in a line of their own or in the cells, lines above the header. Of poses x, y, z are the
commanded TCP, rx, ry, rz its rotation vector from home, A, B, C, W, P, R or qw … qz its orientation against the base, fx … mz the wrench on the tool, t the time, feed the speed along the path.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError, StiffmapError, suggestion
from stiffmap.common.number_text import read_value
from stiffmap.common.tables.cells import Cells
from stiffmap.common.tables.header import meaning_of, split_unit
from stiffmap.common.tables.lines import Spelling, finite_number, is_finite, number
from stiffmap.common.tables.sheet import Layout, read_sheet
from stiffmap.common.tables.table import Table
from stiffmap.common.units import FREQUENCIES, QUANTITIES, SHORT_TIMES, feed_unit, unit_of

SPELLED = {"s": SHORT_TIMES, "percent": {"%": 1.0, "-": 100.0, "1": 100.0}}
"""SI unit -> others that tables of such columns have."""
PER = re.compile(r"_(?:per_)?(min|s|tooth|rev)$")
COUNTER = re.compile(r"(?i)column \d+|unnamed: ?\d+|index|idx|line|sample|frame|record|pose|serial( no)?")
"""Names of columns that may number the rows, or groups of them; programs leave out the name, or write ``Unnamed: 0``."""
WORD = "word"
"""In place of a unit: the column holds text."""


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

    def has(self, name: str) -> bool:
        """Whether a table may have a column of this name, without its unit."""
        return _joined(name) in {*self.units, *self.aliases}


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


def read_named(path: Path, known: Known, sheet: str | None = None) -> NamedTable:
    """A text or a workbook. Raises FileError naming file, line and column, what was expected and what was found."""
    names = ", ".join(known.usual.get(n, n) for n in known.units)
    return named(read_sheet(path, sheet, Layout(known.has, strict=True, names=names)), known)


def named(sheet: Table, known: Known, besides: Collection[int] = ()) -> NamedTable:
    """Columns of a sheet, but some, by their known names; raises FileError."""
    out = NamedTable(sheet.file, list(sheet.lines), sheet.top, {}, {}, {}, {})
    for i, (head, text) in enumerate(zip(sheet.header, sheet.names, strict=True)):
        counts = COUNTER.fullmatch(text) and sheet.is_numeric(i) and {*np.diff(sheet.numbers(i))} <= {0, 1}
        if i in besides or (not known.has(head) and (meaning_of(text) == "id" or counts)):
            continue
        name, unit, size = _meaning(head, known, out, sheet.with_points(i))
        if not name:
            continue
        if name in out.header:
            out.fail(f"a column is given twice, as '{out.header[name]}' and '{head}'")
        out.header[name], out.units[name], out.size[name] = head, unit, size
        words = known.units[name] == WORD
        out.values[name] = (
            list(sheet.columns[i]) if words else size * _numbers(sheet, i, name, out, known.blank)
        )
    return out


def _numbers(sheet: Table, column: int, name: str, table: NamedTable, blank: bool) -> Floats:
    def one(cell: str, row: int) -> float:
        value = number(cell, Spelling())
        if value is None or (value != value and not blank):
            try:
                return finite_number(cell)
            except ValueError as problem:
                expected, found = problem.args
                table.fail(f"expected {expected}, found {found}", name, row)
        return value

    return sheet.with_points(column).numbers(one)


def _joined(name: str) -> str:
    return re.sub(r"\s+", "_", name.lower())


def _meaning(head: str, known: Known, table: NamedTable, cells: Cells) -> tuple[str, str, float]:
    """Name of a column, nothing where no cell is a number, its unit as written, and the SI size of that."""
    text, unit = split_unit(head)
    name = _joined(text)
    if not known.has(text) and not re.search(r"[])]\s*$", head):  # x_per_tooth_mm, real_m/N
        whole = re.sub(r"\s", "_", head)
        cuts = [m.start() for m in re.finditer("_", whole) if known.has(whole[: m.start()])]
        if cuts:
            name, unit = whole[: cuts[-1]].lower(), PER.sub(r"/\1", whole[cuts[-1] + 1 :])
            unit = {"N_m": "N*m"}.get(unit, unit)
    name, unit = known.renamed(name, unit)
    name = known.aliases.get(name, name)
    if name not in known.units and meaning_of(text) in known.units:
        name = meaning_of(text)
    usual = known.usual.get(name, name)
    unlike = name not in known.units and not suggestion(name, known.units)
    if unlike and not any(is_finite(c, Spelling()) for c in cells):
        return "", "", 1.0
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


LOADS = {**dict.fromkeys(("fx", "fy", "fz"), "N"), **dict.fromkeys(("mx", "my", "mz"), "N*m")}
COLUMNS = {
    **dict.fromkeys("xyz", "m"), **dict.fromkeys(("rx", "ry", "rz"), "rad"), **LOADS, "t": "s", "feed": "m/s",
}  # fmt: skip
"""Name of a column of poses -> SI unit."""
USUAL = {"m": "mm", "m/s": "mm/min", "rad": "deg"}
KNOWN = Known(COLUMNS, {n: f"{n} [{USUAL.get(si, si)}]" for n, si in COLUMNS.items()}, {"time": "t"})


class PoseTable(NamedTable):
    """Columns (n,) in SI by name, and the line of each row in the file."""

    @property
    def position(self) -> Floats:
        """(n, 3) m."""
        return self.block("xyz")

    @property
    def wrench(self) -> Floats:
        """(n, 6) N, N·m; zero where there is no column."""
        return self.block([*LOADS])

    @property
    def loaded(self) -> bool:
        """Whether a column is a force or a moment."""
        return not LOADS.keys().isdisjoint(self.values)

    def rotation(self, home: Floats) -> Floats | None:
        """(n, 3, 3) commanded orientations: those of a controller, or turned from `home` about base axes; None: as at home."""
        if not {"rx", "ry", "rz"} & set(self.values):
            return self.values.get("orientation")
        from scipy.spatial.transform import Rotation

        turns: Floats = Rotation.from_rotvec(self.block(("rx", "ry", "rz"))).as_matrix()
        return turns @ home


def read_pose_table(place: Path, *, at_home: Floats | None = None) -> PoseTable:
    """The table of a CSV file.

    `at_home` (3,) m stands in for x, y or z that have no column, along which a planar machine is not commanded; None: all three
    are wanted. Raises FileError naming file, line, column, what was expected and what was found.
    """
    sheet = read_sheet(place, None, Layout(KNOWN.has, strict=True, names=", ".join(KNOWN.usual.values())))
    columns, turns, words = orientation_of(sheet)
    table = PoseTable(**vars(named(sheet, KNOWN, [] if turns == "rotvec" else columns)))
    if columns and turns != "rotvec":
        if {"rx", "ry", "rz"} & set(table.values):
            table.fail("orientations are given twice", sheet.header[columns[0]])
        table.header["orientation"] = f"{', '.join(sheet.header[i] for i in columns)}: {words}"
        table.values["orientation"] = _against_base(sheet, columns, turns)
    missing = [c for c in "xyz" if c not in table.values]
    if missing and (at_home is None or len(missing) == 3):
        table.fail(
            f"no column {', '.join(missing)}; expected x [mm], y [mm], z [mm] and perhaps "
            "t [s], feed [mm/min], fx [N], fy [N], fz [N]"
        )
    for c in missing:
        assert at_home is not None  # refused before
        table.values[c] = np.full(len(table.lines), at_home["xyz".index(c)])
    return table


ANGLE = r"(tcp|pos|ist|soll|nominal|cmd|orientation|ori|rot)?[ _.-]?{}"
TURNS = (
    ("a b c", "ZYX", "turns about z, the new y, the new x (KUKA's A, B, C; degrees where no unit is given)"),
    ("w p r", "xyz", "turns about the fixed x, y, z (Fanuc's W, P, R; degrees where no unit is given)"),
    ("roll pitch yaw", "xyz", "turns about the fixed x, y, z (degrees where no unit is given)"),
    ("(rx|target_tcp_pose_3) (ry|target_tcp_pose_4) (rz|target_tcp_pose_5)", "rotvec", "a rotation vector (UR's RX, RY, RZ)"),
)  # fmt: skip
"""Names of three angles, how they turn, and that in words."""
WXYZ = tuple(rf"(.*[./ ])?(q|quat(ernion)?|rot(ation)?|orientation)[ _./]?{a}" for a in "wxyz")
ROUNDED = 0.01
"""By how much digits of a table may change the length of a quaternion."""


def orientation_of(sheet: Table, taken: Collection[int] = ()) -> tuple[list[int], str, str]:
    """Columns of an orientation, none of them `taken`, how its angles turn (empty: a quaternion, w first), and that in words."""
    forms = [(quaternion(sheet), "", "quaternions, w first")]
    forms += [(_angles(sheet, names), turns, words) for names, turns, words in TURNS]
    return next((f for f in forms if f[0] and not {*taken} & {*f[0]}), ([], "", ""))


def _against_base(sheet: Table, columns: Sequence[int], turns: str) -> Floats:
    from scipy.spatial.transform import Rotation

    values = np.stack([sheet.numbers(i) for i in columns], axis=1)
    sheet.check(~np.isnan(values).any(axis=1), lambda _: f"{sheet.header[columns[0]]} …: found an empty cell")
    if not turns:
        return np.asarray(Rotation.from_quat(values[:, [1, 2, 3, 0]]).as_matrix())
    sizes = [size_in(sheet.unit(i) or "deg", "rad") for i in columns]
    return np.asarray(Rotation.from_euler(turns, sizes * values).as_matrix())


def quaternion(sheet: Table) -> list[int]:
    """Columns w x y z of quaternions, by their names (Motive: Rotation W, ROS: pose.orientation.w) and length of one, or none."""
    # q1 is a joint next to Q0 to Q3
    numbered = ([f"(?-i:{q}{k + i})" for i in range(4)] for k in (1, 0) for q in "qQ")
    for names in (WXYZ, *numbered, ("q0", *WXYZ[1:])):
        at = [i for i in map(sheet.find, names) if i is not None and sheet.is_numeric(i)]
        if len(at) == 4:
            size = np.linalg.norm([sheet.numbers(i) for i in at], axis=0)
            if np.nanmax(np.abs(size - 1.0), initial=0.0) < ROUNDED and not np.isnan(size).all():
                return at
    return []


def _angles(sheet: Table, names: str) -> list[int]:
    """Three columns of angles, or none."""
    at = [sheet.find(ANGLE.format(name)) for name in names.split()]
    columns = [i for i in at if i is not None and sheet.is_numeric(i)]
    gauges = any((u := sheet.unit(i)) and unit_of(u, "angle") is None for i in columns)
    return [] if gauges or len(columns) < 3 else columns
