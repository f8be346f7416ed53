"""A table of tap tests: one row per mode that a modal program found, or per measured response, at a pose of the machine."""

from __future__ import annotations

from dataclasses import dataclass, fields
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError
from stiffmap.common.pose_tables import cell_number, rows_of
from stiffmap.identification.taps.responses import NOISE, Measured, modes_of
from stiffmap.solve.machine import Machine

POSE = ("x_mm", "y_mm", "z_mm")
WAY = ("dir_x", "dir_y", "dir_z")
ABOVE_ZERO = ("frequency_Hz", "u_Hz", "u_damping_percent", "u_dir")
NUMBERS = (*POSE, *ABOVE_ZERO, "damping_percent", *WAY)
WORDS = ("response", "along", "hammer")
SHARE = 0.01
"""Standard uncertainty of a frequency where none is given, relative."""
DAMPING_SHARE = 0.2
"""Standard uncertainty of a damping ratio where none is given, relative."""


@dataclass(frozen=True, eq=False)
class TapTest:
    """Modes (n) found by tapping, base axes, SI; NaN where a number was not measured."""

    position: Floats
    """(n, 3) m, commanded TCP."""
    frequency: Floats
    """(n,) Hz."""
    u: Floats
    """(n,) Hz, standard uncertainty."""
    ratio: Floats
    """(n,) damping ratio."""
    direction: Floats
    """(n, 3) unit vectors along which the tool moves; NaN also where the shape is noise."""
    u_ratio: Floats = None  # type: ignore[assignment]
    """(n,) standard uncertainty of the damping ratio; 20 % where left out."""
    flexibility: Floats = None  # type: ignore[assignment]
    """(n, 3) m/N, motion of the TCP by a force of the hammer, as far as the mode carries it."""
    u_flexibility: Floats = None  # type: ignore[assignment]
    hammer: Floats = None  # type: ignore[assignment]
    """(n, 3) unit vectors of the hammer's force."""
    lever: Floats = None  # type: ignore[assignment]
    """(n, 3) m from the TCP to the point that it strikes."""

    def __post_init__(self) -> None:
        unknown = np.full((len(self.frequency), 3), np.nan)
        for name, value in (
            ("u_ratio", DAMPING_SHARE * self.ratio), ("flexibility", unknown), ("u_flexibility", unknown),
            ("hammer", unknown), ("lever", 0 * self.position),
        ):  # fmt: skip
            if getattr(self, name) is None:
                object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.frequency)

    @property
    def poses(self) -> tuple[Floats, NDArray[np.intp]]:
        """Distinct positions, and which of them each row is at."""
        once, back = np.unique(self.position, axis=0, return_inverse=True)
        return once, back.reshape(-1)

    def rows(self, keep: NDArray[np.bool_]) -> TapTest:
        """Some of the rows."""
        return TapTest(*(getattr(self, f.name)[keep] for f in fields(self)))


def load_taps(path: str | PathLike[str], machine: Machine | None = None) -> TapTest:
    """Table of tap tests from a CSV file.

    Columns x_mm, y_mm, z_mm (commanded TCP) and frequency_Hz; where known u_Hz (else 1 %), damping_percent, u_damping_percent (else
    20 % of it), dir_x, dir_y, dir_z (along which the tool moves in the mode, any length) and u_dir (of each of them). In place of
    frequency_Hz, `response` names a file of `read_responses` next to the table, measured at the TCP along the axis `along` (+x to -z)
    with the hammer along the axis `hammer`; universal files may say both themselves. Rows of one pose and hammer share their modes.

    machine: whose workspace the poses are checked against; None: they are not. Raises FileError naming line and column.
    """
    p, file = Path(path), str(path)
    if not p.is_file():
        raise FileError("no such table of tap tests", file=file)
    (first, names), *rows = rows_of(p) if p.stat().st_size else [(1, [])]
    head = [h.strip() for h in names]
    missing, unknown = [c for c in POSE if c not in head], [c for c in head if c not in NUMBERS + WORDS]
    if not {"frequency_Hz", "response"} & set(head):
        missing.append("frequency_Hz or response")
    if missing or unknown or not rows:
        what = (
            f"missing {', '.join(missing)}"
            if missing
            else f"unknown {', '.join(unknown)}"
            if unknown
            else "no rows"
        )
        raise FileError(
            f"expected the columns {', '.join(NUMBERS + WORDS)}, all but the pose where known; {what}",
            file=file, line=first,
        )  # fmt: skip
    typed: list[dict[str, object]] = []
    measured: list[Measured] = []
    places = []
    for line, cells in rows:
        if len(cells) != len(head):
            raise FileError(f"expected {len(head)} cells, found {len(cells)}", file=file, line=line)
        row = dict(zip(head, map(str.strip, cells), strict=True))
        n = _numbers(row, file, line)
        at = (1e-3 * n["x_mm"], 1e-3 * n["y_mm"], 1e-3 * n["z_mm"])
        places.append(at)
        if row.get("response"):
            given = [c for c in NUMBERS[3:] if row.get(c)]
            if given:
                raise FileError(f"expected no {given[0]} with a response", file=file, line=line, key=given[0])
            place = p.parent / row["response"]
            measured.append(Measured(at, place, row.get("along", ""), row.get("hammer", ""), file, line))
        else:
            typed.append(_typed(n, at))
    if machine is not None:
        _check_unit(np.array(places), machine, file, [line for line, _ in rows])
    found = typed + modes_of(measured)
    return TapTest(**{f.name: np.array([row[f.name] for row in found], float) for f in fields(TapTest)})


def _numbers(row: dict[str, str], file: str, line: int) -> dict[str, float]:
    """Numbers of a row by column, NaN where a cell that may be empty is."""
    needed = {*POSE} if row.get("response") else {*POSE, "frequency_Hz"}
    if any(row.get(c) for c in WAY):
        needed |= {*WAY}
    n = {
        c: cell_number(row.get(c, ""), c, file, line) if c in needed or row.get(c) else np.nan
        for c in NUMBERS
    }
    wrong = [c for c in ABOVE_ZERO if n[c] <= 0]
    if not 0 <= n["damping_percent"] < 100 and not np.isnan(n["damping_percent"]):
        wrong.append("damping_percent")
    if wrong:
        what = "a number from 0 to below 100" if wrong[0] == "damping_percent" else "a number above zero"
        raise FileError(f"expected {what}, found {n[wrong[0]]:g}", file=file, line=line, key=wrong[0])
    return n


def _typed(n: dict[str, float], at: tuple[float, float, float]) -> dict[str, object]:
    f, way = n["frequency_Hz"], np.array([n[c] for c in WAY])
    size, ratio = float(np.linalg.norm(way)), n["damping_percent"] / 100 or np.nan
    shape = size > 0 and not size < NOISE * n["u_dir"]
    share = n["u_damping_percent"] / 100
    unknown = np.full(3, np.nan)
    return {
        "position": at, "frequency": f, "u": SHARE * f if np.isnan(n["u_Hz"]) else n["u_Hz"], "ratio": ratio,
        "direction": way / size if shape else unknown,
        "u_ratio": DAMPING_SHARE * ratio if np.isnan(share) else share,
        "flexibility": unknown, "u_flexibility": unknown, "hammer": unknown, "lever": np.zeros(3),
    }  # fmt: skip


def _check_unit(position: Floats, machine: Machine, file: str, lines: list[int]) -> None:
    """FileError where poses are plainly metres (or micrometres) in columns of millimetres."""
    low, high = machine.workspace
    span = np.linalg.norm(high - low)
    at_origin = len(np.unique(position, axis=0)) > 1 and (np.abs(position) < 2e-3 * span).all()
    for unit, factor in (("metres", 1e3), ("micrometres", 1e-3)):
        other = _far(factor * position, low, high) < 0.5 * span
        wrong = other & ((_far(position, low, high) > 0.5 * span) | (factor > 1 and at_origin))
        if wrong.any():
            i = int(np.argmax(wrong))
            x, y, z = 1e3 * position[i]
            box = ", ".join(
                f"{a} {1e3 * u:g} to {1e3 * v:g}" for a, u, v in zip("xyz", low, high, strict=True)
            )
            raise FileError(
                f"expected a pose in mm near the workspace ({box}); found {x:g}, {y:g}, {z:g}, which are {unit}",
                file=file, line=lines[i], key=", ".join(POSE),
            )  # fmt: skip


def _far(position: Floats, low: Floats, high: Floats) -> Floats:
    """(n,) m, distance from a box."""
    return np.asarray(np.linalg.norm(position - np.clip(position, low, high), axis=1))
