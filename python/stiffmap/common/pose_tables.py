"""Tables of poses (CSV), one convention for all commands: every column with its unit in the header.

``x [mm]`` or ``x_mm``; x, y, z the commanded TCP, rx, ry, rz its rotation vector from home, fx … mz the wrench on the tool, t the
time, feed the speed along the path. Order and case are free; cells are separated by commas, semicolons or tabs; lines that
start with # are remarks. docs/machine_files.md lists the columns.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.common.number_text import number_in
from stiffmap.common.units import name_and_unit
from stiffmap.common.value_units import read_value

COLUMNS = {
    **dict.fromkeys(("x", "y", "z"), "m"),
    **dict.fromkeys(("rx", "ry", "rz"), "rad"),
    **dict.fromkeys(("fx", "fy", "fz"), "N"),
    **dict.fromkeys(("mx", "my", "mz"), "N*m"),
    "t": "s",
    "feed": "m/s",
}
USUAL = {"m": "mm", "m/s": "mm/min", "rad": "deg", "N*m": "N*m"}
PLAIN = {
    "mm_min": "mm/min",
    "m_min": "m/min",
    "mm_s": "mm/s",
    "m_s": "m/s",
    "Nm": "N*m",
    "N_m": "N*m",
    "Nmm": "N*mm",
}


@dataclass(frozen=True, eq=False)
class PoseTable:
    """Columns (n,) in SI by name, and the line of each row in the file."""

    file: str
    columns: dict[str, Floats]
    lines: list[int]

    def __len__(self) -> int:
        return len(self.lines)

    @property
    def position(self) -> Floats:
        """(n, 3) m."""
        return self.block("xyz")

    @property
    def wrench(self) -> Floats:
        """(n, 6) N, N·m; zero where there is no column."""
        return self.block(("fx", "fy", "fz", "mx", "my", "mz"))

    @property
    def loaded(self) -> bool:
        """Whether a column is a force or a moment."""
        return any(c in self.columns for c in ("fx", "fy", "fz", "mx", "my", "mz"))

    def block(self, names: Sequence[str]) -> Floats:
        """(n, names); zero where there is no column."""
        return np.stack([self.columns.get(c, np.zeros(len(self))) for c in names], axis=1)

    def rotation(self, home: Floats) -> Floats | None:
        """(n, 3, 3) commanded orientations, turned from `home` about base axes; None: as at home."""
        if not {"rx", "ry", "rz"} & set(self.columns):
            return None
        from scipy.spatial.transform import Rotation

        turns: Floats = Rotation.from_rotvec(self.block(("rx", "ry", "rz"))).as_matrix()
        return turns @ home


def read_pose_table(place: Path, *, at_home: Floats | None = None) -> PoseTable:
    """The table of a CSV file.

    `at_home` (3,) m stands in for x, y or z that have no column, along which a planar machine is not commanded; None: all three
    are wanted. Raises FileError naming file, line, column, what was expected and what was found.
    """
    file = str(place)
    rows = rows_of(place)
    number, head = rows[0]
    heads = [_head(cell, file, number) for cell in head]
    names = [n for n, _ in heads]
    if twice := [n for n in names if names.count(n) > 1]:
        raise FileError(f"the column {twice[0]} is there twice", file=file, line=number)
    missing = [c for c in "xyz" if c not in names]
    if missing and (at_home is None or len(missing) == 3):
        raise FileError(
            f"no column {', '.join(missing)}; expected x [mm], y [mm], z [mm] and perhaps "
            "t [s], feed [mm/min], fx [N], fy [N], fz [N]",
            file=file, line=number,
        )  # fmt: skip
    if len(rows) < 2:
        raise FileError("expected one row or more below the header", file=file, line=number)
    out = np.zeros((len(rows) - 1, len(heads)))
    for i, (line, row) in enumerate(rows[1:]):
        for j, (name, scale) in enumerate(heads):
            out[i, j] = scale * cell_number(row[j] if j < len(row) else "", name, file, line)
    columns = {name: out[:, j] for j, (name, _) in enumerate(heads)}
    for c in missing:
        assert at_home is not None  # refused before
        columns[c] = np.full(len(out), at_home["xyz".index(c)])
    return PoseTable(file, columns, [line for line, _ in rows[1:]])


def rows_of(place: Path) -> list[tuple[int, list[str]]]:
    """Lines of a CSV file with their cells, without remarks and empty lines; FileError."""
    file = str(place)
    try:
        text = place.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"cannot be read: {getattr(error, 'strerror', None) or error}", file=file) from error
    lines = text.splitlines()
    first = next((s for s in lines if s.strip() and not s.lstrip().startswith("#")), "")
    separator = next((s for s in (";", "\t") if s in first), ",")
    rows = [
        (i, next(csv.reader([line], delimiter=separator)))
        for i, line in enumerate(lines, 1)
        if line.replace(separator, "").strip() and not line.lstrip().startswith("#")
    ]
    if not rows:
        raise FileError("the file is empty", file=file)
    return rows


def cell_number(text: str, name: str, file: str, line: int) -> float:
    """The finite number of a cell; FileError naming file, line and column."""
    found = f"'{text.strip()}'" if text.strip() else "an empty cell"
    try:
        value = number_in(text.strip())
    except ValueError:
        raise FileError(f"expected a number, found {found}", file=file, line=line, key=name) from None
    if not math.isfinite(value):
        raise FileError(f"expected a finite number, found {found}", file=file, line=line, key=name)
    return value


def _head(cell: str, file: str, line: int) -> tuple[str, float]:
    """Name of a column, and the SI size of its unit."""
    name, unit = name_and_unit(cell.replace("(", "[").replace(")", "]"))
    name = name.lower()
    if not unit and name not in COLUMNS and (match := re.fullmatch(r"([A-Za-z]+)_(\w+)", cell.strip())):
        name, unit = match[1].lower(), PLAIN.get(match[2], match[2])
    if name not in COLUMNS:
        raise FileError(
            f"unknown column '{cell.strip()}'; known: {', '.join(COLUMNS)}, each with its unit as in x [mm]",
            file=file, line=line,
        )  # fmt: skip
    si = COLUMNS[name]
    if not unit:
        raise FileError(
            f"the unit is missing: write {name} [{USUAL.get(si, si)}]", file=file, line=line, key=name
        )
    per_minute = unit.endswith("/min")
    try:
        size = read_value(f"1 {unit.removesuffix('min') + 's' if per_minute else unit}", si)
    except StiffmapError as error:
        raise FileError(str(error), file=file, line=line, key=name) from None
    return name, size / 60 if per_minute else size
