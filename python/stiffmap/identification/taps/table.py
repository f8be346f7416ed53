"""A table of tap tests: one row per mode that a modal program found, at a pose of the machine."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError

NEEDED = ("x_mm", "y_mm", "z_mm", "frequency_Hz")
KNOWN = (*NEEDED, "u_Hz", "damping_percent", "dir_x", "dir_y", "dir_z")
SHARE = 0.01
"""Standard uncertainty of a frequency where none is given, relative."""


@dataclass(frozen=True, eq=False)
class TapTest:
    """Modes (n) found by tapping, base axes, SI."""

    position: Floats
    """(n, 3) m, commanded TCP."""
    frequency: Floats
    """(n,) Hz."""
    u: Floats
    """(n,) Hz, standard uncertainty."""
    ratio: Floats
    """(n,) damping ratio; NaN where none was found."""
    direction: Floats
    """(n, 3) unit vectors along which the tool moves; NaN where none was found."""

    def __len__(self) -> int:
        return len(self.frequency)

    @property
    def poses(self) -> tuple[Floats, NDArray[np.intp]]:
        """Distinct positions, and which of them each row is at."""
        once, back = np.unique(self.position, axis=0, return_inverse=True)
        return once, back.reshape(-1)

    def rows(self, keep: NDArray[np.bool_]) -> TapTest:
        """Some of the rows."""
        return TapTest(
            *(getattr(self, n)[keep] for n in ("position", "frequency", "u", "ratio", "direction"))
        )


def load_taps(path: str | PathLike[str]) -> TapTest:
    """Table of tap tests from a CSV file.

    Columns x_mm, y_mm, z_mm (commanded TCP), frequency_Hz; where known u_Hz (else 1 %), damping_percent and dir_x, dir_y, dir_z
    (along which the tool moves in the mode, any length). Raises FileError naming row and column.
    """
    p = Path(path)
    if not p.is_file():
        raise FileError("no such table of tap tests", file=str(path))
    with p.open(newline="", encoding="utf-8-sig") as file:
        table = csv.reader(file)
        filled = [
            (table.line_num, r)
            for r in table
            if any(c.strip() for c in r) and not r[0].lstrip().startswith("#")
        ]
    lines, rows = [n for n, _ in filled], [r for _, r in filled]
    head = [h.strip() for h in rows[0]] if rows else []
    missing, unknown = [c for c in NEEDED if c not in head], [c for c in head if c not in KNOWN]
    if missing or unknown or len(rows) < 2:
        what = (
            f"missing {', '.join(missing)}"
            if missing
            else f"unknown {', '.join(unknown)}"
            if unknown
            else "no rows"
        )
        raise FileError(
            f"expected the columns {', '.join(KNOWN)} (from u_Hz on where known); {what}", file=str(path)
        )
    data = {c: np.full(len(rows) - 1, np.nan) for c in KNOWN}
    for i, row in enumerate(rows[1:]):
        if len(row) != len(head):
            raise FileError(
                f"expected {len(head)} cells, found {len(row)}", file=str(path), line=lines[i + 1]
            )
        for name, cell in zip(head, row, strict=True):
            data[name][i] = _number(cell, name, str(path), lines[i + 1])
    f = data["frequency_Hz"]
    for name, wrong in (
        ("frequency_Hz", ~(f > 0)),
        ("u_Hz", ~np.isnan(data["u_Hz"]) & ~(data["u_Hz"] > 0)),
        ("damping_percent", (data["damping_percent"] < 0) | (data["damping_percent"] >= 100)),
    ):
        if wrong.any():
            i = int(np.argmax(wrong))
            raise FileError(
                f"{name}: expected a number above zero, found {data[name][i]:g}",
                file=str(path),
                line=lines[i + 1],
            )
    way = np.stack([data[f"dir_{a}"] for a in "xyz"], axis=1)
    size = np.linalg.norm(way, axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        way = np.where(size > 0, way / size, np.nan)
    position = 1e-3 * np.stack([data[c] for c in NEEDED[:3]], axis=1)
    u = np.where(np.isnan(data["u_Hz"]), SHARE * f, data["u_Hz"])
    return TapTest(position, f, u, data["damping_percent"] / 100, way)


def _number(cell: str, name: str, file: str, line: int) -> float:
    if not cell.strip() and name not in NEEDED:
        return float("nan")
    try:
        value = float(cell)
    except ValueError:
        value = float("nan")
    if not np.isfinite(value):
        raise FileError(f"{name}: expected a number, found {cell.strip()!r}", file=file, line=line)
    return value
