"""Tables of poses, one convention for all commands: x, y, z are the commanded TCP, rx, ry, rz its rotation vector from home, A, B, C,
W, P, R or qw … qz its orientation against the base, fx … mz the wrench on the tool, t the time, feed the speed along the path.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from os import PathLike

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.short import first_of
from stiffmap.common.tables.header import IN_SI, stated_unit
from stiffmap.common.tables.named import Known, NamedTable, known_sheet, named
from stiffmap.common.tables.orientation import VECTOR, matrices_of, no_vector, orientation_of
from stiffmap.common.tables.table import Table
from stiffmap.common.tables.table_file import table_file

LOADS = {**dict.fromkeys(("fx", "fy", "fz"), "N"), **dict.fromkeys(("mx", "my", "mz"), "N*m")}
COLUMNS = {
    **dict.fromkeys("xyz", "m"), **dict.fromkeys(("rx", "ry", "rz"), "rad"), **LOADS, "t": "s", "feed": "m/s",
}  # fmt: skip
"""Name of a column of poses -> SI unit."""
USUAL = {"m": "mm", "m/s": "mm/min", "rad": "deg"}
SPELLED_POSES = {"t": "time"} | {f"r{a}": f"rot{a}" for a in "xyz"}
KNOWN = Known(
    COLUMNS, {n: f"{n} [{USUAL.get(si, si)}]" for n, si in COLUMNS.items()}, SPELLED_POSES,
    aside="(tcp_)?(velocity|speed|acceleration)(_?[xyz])?|spindle|rpm", titled="xyz",
)  # fmt: skip


@dataclass(eq=False)
class PoseTable(NamedTable):
    """Columns (n,) in SI by name, and the line of each row in the file."""

    orientation: Floats | None = None
    """(n, 3, 3) against the base, as a controller has it; None where the table has no such columns."""
    turns: str = ""
    """Against what, which columns and how they turn, in words."""
    actuators: Floats | None = None
    """(n, actuators) m, rad, where joints are commanded in place of positions, which are NaN then."""

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
            return self.orientation
        return np.asarray(matrices_of(self.block(("rx", "ry", "rz")), VECTOR) @ home)


def read_pose_table(
    place: str | PathLike[str],
    *,
    at_home: Floats | None = None,
    known: Known = KNOWN,
    joints: Callable[[Table], tuple[Sequence[int], Floats | None]] = lambda sheet: ((), None),
) -> PoseTable:
    """The table of a text, a workbook or a `TableFile`, whose columns are the `known` ones and those of an orientation.

    `at_home` (3,) m stands in for x, y or z that have no column, along which a planar machine is not commanded; None: all three
    are wanted, or what `joints` finds: columns of commanded joints, and their coordinates (n, actuators). Raises FileError naming
    file, line, column, what was expected and what was found.
    """
    sheet = known_sheet(place, known)
    if sheet.find("target_tcp_pose_0") is None:  # then the pose that was measured stands for it
        header = (re.sub("(?i)^actual(?=_tcp_pose)", "target", h) for h in sheet.header)
        sheet = replace(sheet, header=tuple(header))
    placed = any(known.name_of(h)[0] in ("x", "y", "z") for h in sheet.header)
    of_joints, actuators = ((), None) if placed else joints(sheet)
    found = orientation_of(sheet, of_joints)
    from_home = found.turns == VECTOR and not IN_SI.fullmatch(sheet.names[found.columns[0]])  # rx, ry, rz
    columns = () if from_home else found.columns
    table = PoseTable(**vars(named(sheet, known, (*columns, *of_joints))), actuators=actuators)
    if columns:
        if {"rx", "ry", "rz"} & set(table.values):
            table.fail("orientations are given twice", sheet.header[columns[0]])
        table.turns = f"against the base: {first_of([sheet.header[i] for i in columns], 4)}: {found.words}"
        usual = table_file(place).units.get("angle") or stated_unit(sheet.above, "angle")
        table.orientation = found.matrices(sheet, usual)
    elif turned := [table.header[n] for n in ("rx", "ry", "rz") if n in table.values]:
        table.turns = f"from home: {', '.join(turned)}: a rotation vector"
        if wrong := no_vector(table.block(("rx", "ry", "rz"))):
            table.fail(wrong, turned[0])
    missing = [c for c in "xyz" if c not in table.values]
    if actuators is not None:
        if table.turns:
            table.fail(f"joints are commanded, so the orientation follows from them; found it {table.turns}")
        at_home = np.full(3, np.nan)
    elif missing and (at_home is None or len(missing) == 3):
        table.fail(
            f"no column {', '.join(missing)}; expected x [mm], y [mm], z [mm] and perhaps "
            "t [s], feed [mm/min], fx [N], fy [N], fz [N]"
        )
    for c in missing:
        assert at_home is not None  # refused before
        table.values[c] = np.full(len(table.lines), at_home["xyz".index(c)])
    return table
