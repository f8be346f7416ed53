"""A table of tap tests: one row per mode that a modal program found, or per measured response, at a pose of the machine."""

from __future__ import annotations

from dataclasses import dataclass, fields
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError
from stiffmap.common.tables.named import WORD, Known, NamedTable, read_named
from stiffmap.identification.taps.responses import NOISE, Measured, modes_of
from stiffmap.solve.machine import Machine

POSE, WAY = ("x", "y", "z"), ("dir_x", "dir_y", "dir_z")
ABOVE_ZERO = ("frequency", "u", "u_damping", "u_dir")
NUMBERS = (*POSE, *ABOVE_ZERO, "damping", *WAY)
UNITS = {
    **dict.fromkeys(POSE, "m"), "frequency": "Hz", "u": "Hz", "u_damping": "percent", "u_dir": "", "damping": "percent",
    **dict.fromkeys(WAY, ""), **dict.fromkeys(("response", "along", "hammer"), WORD),
}  # fmt: skip
USUAL = {n: f"{n}_{ {'m': 'mm'}.get(u, u) }" for n, u in UNITS.items() if u not in ("", WORD)}
KNOWN = Known(UNITS, USUAL, {}, blank=True)
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
    t = read_named(p, KNOWN)
    missing = [USUAL[c] for c in POSE if c not in t.values]
    if not {"frequency", "response"} & set(t.values):
        missing.append("frequency_Hz or response")
    if missing:
        t.fail(
            f"expected the columns {', '.join(USUAL.get(c, c) for c in UNITS)}, all but the pose where known; missing "
            f"{', '.join(missing)}"
        )
    for name in ABOVE_ZERO:
        if name in t.values:
            t.check(name, t.values[name] > 0, "a number above zero")
    if "damping" in t.values:
        t.check(
            "damping",
            (t.values["damping"] >= 0) & (t.values["damping"] < 100),
            "a number from 0 to below 100",
        )
    typed: list[dict[str, object]] = []
    measured: list[Measured] = []
    places = [(float(x), float(y), float(z)) for x, y, z in t.block(POSE)]
    for i, at in enumerate(places):
        n, response = _numbers(t, i)
        along, hammer = (t.values[c][i] if c in t.values else "" for c in ("along", "hammer"))
        if response:
            measured.append(Measured(at, p.parent / response, along, hammer, file, t.lines[i]))
        else:
            typed.append(_typed(n, at))
    if machine is not None:
        _check_unit(np.array(places), machine, file, t.lines)
    found = typed + modes_of(measured)
    return TapTest(**{f.name: np.array([row[f.name] for row in found], float) for f in fields(TapTest)})


def _numbers(t: NamedTable, i: int) -> tuple[dict[str, float], str]:
    """Numbers of a row by column, NaN where a cell that may be empty is, and the file of its response."""
    n = {c: float(t.values[c][i]) if c in t.values else np.nan for c in NUMBERS}
    response = str(t.values["response"][i]) if "response" in t.values else ""
    needed = {*POSE} if response else {*POSE, "frequency"}
    if not all(np.isnan(n[c]) for c in WAY):
        needed |= {*WAY}
    for c in NUMBERS:
        if c in needed and np.isnan(n[c]):
            t.fail("expected a number, found an empty cell", c, i)
        if response and c not in POSE and not np.isnan(n[c]):
            t.fail(f"expected no {t.header[c]} with a response", c, i)
    return n, response


def _typed(n: dict[str, float], at: tuple[float, float, float]) -> dict[str, object]:
    f, way = n["frequency"], np.array([n[c] for c in WAY])
    size, ratio = float(np.linalg.norm(way)), n["damping"] / 100 or np.nan
    shape = size > 0 and not size < NOISE * n["u_dir"]
    share = n["u_damping"] / 100
    unknown = np.full(3, np.nan)
    return {
        "position": at, "frequency": f, "u": SHARE * f if np.isnan(n["u"]) else n["u"], "ratio": ratio,
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
                file=file, line=lines[i], key="x_mm, y_mm, z_mm",
            )  # fmt: skip


def _far(position: Floats, low: Floats, high: Floats) -> Floats:
    """(n,) m, distance from a box."""
    return np.asarray(np.linalg.norm(position - np.clip(position, low, high), axis=1))
