"""Paths by built-in name or from a file."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Mapping, Sequence
from math import isfinite, nan, pi
from os import PathLike
from pathlib import Path

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError
from stiffmap.common.number_text import number_in
from stiffmap.machining.toolpath.gcode.load import lines_of, load_gcode
from stiffmap.machining.toolpath.outlines import outline, outline_names
from stiffmap.machining.toolpath.path import Toolpath, path_of
from stiffmap.model.files.schema.base import suggestion

GCODE = (".ngc", ".nc", ".gcode", ".tap", ".cnc", ".mpf", ".g")
CL = (".cl", ".cls", ".apt", ".cldata", ".aptsource")


def load_path(
    name_or_file: str | PathLike[str],
    *,
    size: tuple[float, ...] | None = None,
    feed: float | None = None,
    spindle: float | None = None,
    offsets: Mapping[str, Sequence[float]] | None = None,
    progress: Callable[[int], None] | None = None,
) -> Toolpath:
    """A built-in outline by name (washbasin, bathtub, rectangle, circle, pocket; size in m), or a file: G-code (.ngc …),
    a CL file of APT (.cl, .apt …) or a table of points (.csv).

    feed (m/s) and spindle (rad/s): of a built-in outline. offsets: work offsets of G-code by name, m. progress: called with the number of lines read. Raises FileError.
    """
    if str(name_or_file) in outline_names():
        speeds = {"feed": feed, "rpm": None if spindle is None else spindle * 30 / pi}
        return outline(str(name_or_file), size, **{k: v for k, v in speeds.items() if v is not None})
    path = Path(name_or_file)
    if not path.is_file():
        raise FileError(
            f"no such file, and no built-in outline of that name{suggestion(path.stem, outline_names())}; "
            f"these are: {', '.join(outline_names())}",
            file=str(name_or_file),
        )
    if size is not None:
        raise FileError("size: only a built-in outline takes one", file=str(path))
    suffix = path.suffix.lower()
    if suffix in GCODE:
        return load_gcode(path, offsets=offsets, progress=progress)
    if suffix in CL:
        return read_cl(path)
    if suffix == ".csv":
        return read_points(path)
    known = ", ".join((*GCODE, *CL, ".csv"))
    raise FileError(f"unknown kind of path {suffix!r}; known: {known}", file=str(path))


LENGTHS = {"mm": 1e-3, "m": 1.0, "in": 25.4e-3, "inch": 25.4e-3}
FEEDS = {"mm/min": 1e-3 / 60, "m/min": 1 / 60, "mm/s": 1e-3, "m/s": 1.0, "in/min": 25.4e-3 / 60}
FILE_FEEDS = {"mm_min": "mm/min", "m_min": "m/min", "mm_s": "mm/s", "m_s": "m/s"}


def read_points(path: Path) -> Toolpath:
    """Rows x_mm, y_mm, z_mm (or ``x [mm]`` …), and where given feed_mm_min, spindle_rpm, i, j, k (tool axis).

    Raises FileError naming the column or the line.
    """
    file = str(path)
    rows = list(csv.reader(r for r in lines_of(path) if not r.lstrip().startswith("#") and r.strip()))
    if len(rows) < 3:
        raise FileError("expected a line of names and two or more points", file=file)
    columns = [_column(n, file) for n in rows[0]]
    names = [n for n, _ in columns]
    missing = [a for a in "xyz" if a not in names]
    if missing:
        raise FileError(f"missing column {missing[0]}_mm", file=file, line=1)
    if len(set(names)) < len(names):
        raise FileError("a column is given twice", file=file, line=1)
    values = np.full((len(rows) - 1, len(names)), nan)
    for i, row in enumerate(rows[1:]):
        if len(row) != len(names):
            raise FileError(f"expected {len(names)} values, found {len(row)}", file=file, line=i + 2)
        for k, cell in enumerate(row):
            values[i, k] = _number(cell, rows[0][k], file, i + 2) * columns[k][1]
    got = dict(zip(names, values.T, strict=True))
    feed = got.get("feed", np.full(len(values), nan))
    if (feed <= 0).any():
        raise FileError("expected a feed above zero", file=file, line=int(np.argmax(feed <= 0)) + 2)
    spindle = got.get("spindle", np.full(len(values), nan))
    if (spindle <= 0).any():
        raise FileError("the spindle is off in a cut", file=file, line=int(np.argmax(spindle <= 0)) + 2)
    axes = [a for a in "ijk" if a in got]
    if axes and len(axes) < 3:
        raise FileError("the tool's axis needs the columns i, j and k", file=file, line=1)
    tool: Floats = np.stack([got[a] for a in "ijk"], axis=1) if axes else np.array([0.0, 0.0, 1.0])
    if axes and not (np.linalg.norm(tool, axis=1) > 0).all():
        where = int(np.argmin(np.linalg.norm(tool, axis=1))) + 2
        raise FileError("expected a direction of the tool that is not zero", file=file, line=where)
    points = np.stack([got[a] for a in "xyz"], axis=1)
    return path_of(
        points, feed=feed, spindle=spindle, tool=tool, lines=np.arange(2, len(values) + 2), name=path.stem,
        turn=got.get("turn"),
    )  # fmt: skip


def _column(header: str, file: str) -> tuple[str, float]:
    """Name and SI size of a column: ``x_mm``, ``x [mm]``, ``feed_mm_min``, ``spindle_rpm``, ``i``."""
    text = header.strip()
    match = re.fullmatch(r"(\w+?)(?:_(mm_min|m_min|mm_s|m_s|mm|m|in|rpm|deg)|\s*\[\s*([\w/]+)\s*\])?", text)
    if match is None:
        raise FileError(
            f"column {text!r}: expected such as x_mm, feed_mm_min, spindle_rpm, i", file=file, line=1
        )
    name, unit = match[1], match[2] or match[3] or ""
    unit = FILE_FEEDS.get(unit, unit)
    if name in "ijk" and len(name) == 1 and not unit:
        return name, 1.0
    tables = {
        "x": LENGTHS,
        "y": LENGTHS,
        "z": LENGTHS,
        "feed": FEEDS,
        "spindle": {"rpm": pi / 30},
        "turn": {"deg": pi / 180},
    }
    if name not in tables:
        raise FileError(
            f"unknown column {text!r}; known: x_mm, y_mm, z_mm, feed_mm_min, spindle_rpm, i, j, k, turn_deg",
            file=file,
            line=1,
        )
    if unit not in tables[name]:
        what = "the unit is missing" if not unit else f"unknown unit {unit!r}"
        raise FileError(
            f"column {text!r}: {what}; expected such as {name}_{'mm' if name in 'xyz' else {'feed': 'mm_min', 'turn': 'deg'}.get(name, 'rpm')}",
            file=file,
            line=1,
        )
    return name, tables[name][unit]


def _number(text: str, column: str, file: str, line: int) -> float:
    try:
        value = number_in(text)
    except ValueError:
        value = nan
    if not isfinite(value) or abs(value) > 1e9:
        raise FileError(
            f"{column.strip()}: expected a number, found {text.strip()[:30]!r}", file=file, line=line
        )
    return value


SILENT = (
    "PARTNO",
    "PPRINT",
    "REMARK",
    "$$",
    "TOOLNO",
    "LOADTL",
    "LOAD",
    "CUTTER",
    "COOLNT",
    "MACHIN",
    "MULTAX",
    "CLRSRF",
    "FROM/NONE",
)
ENDS = ("FINI", "END", "STOP", "REWIND")


def read_cl(path: Path) -> Toolpath:
    """A CL file of APT: UNITS, GOTO (with the tool's axis where it has six numbers), FROM, FEDRAT, RAPID, SPINDL.

    Raises FileError naming the line; what is not understood is refused.
    """
    file = str(path)
    unit, feed, spindle, rapid = 0.0, nan, nan, False
    points: list[list[float]] = []
    tools, feeds, spindles, lines, rapids = [], [], [], [], []
    pending = ""
    for number, raw in enumerate(lines_of(path), 1):
        text = pending + raw.split("$$")[0].strip()
        if text.endswith("$"):
            pending = text[:-1]
            continue
        pending = ""
        word, _, rest = text.partition("/")
        word, values = word.strip().upper(), [v.strip().upper() for v in rest.split(",") if v.strip()]
        if not word or word in SILENT:
            continue
        if word in ENDS:
            break
        if word == "UNITS":
            names = {"MM": 1e-3, "INCHES": 25.4e-3, "INCH": 25.4e-3, "CM": 1e-2}
            if not values or values[0] not in names:
                raise FileError(f"UNITS: expected MM or INCHES, found {rest[:20]!r}", file=file, line=number)
            unit = names[values[0]]
        elif word in ("GOTO", "FROM"):
            if not unit:
                raise FileError(
                    "the unit is missing: expected UNITS/MM before the first point", file=file, line=number
                )
            v = [_number(t, word, file, number) for t in values]
            if len(v) not in (3, 6):
                raise FileError(f"{word}: expected 3 or 6 numbers, found {len(v)}", file=file, line=number)
            axis = v[3:] or [0.0, 0.0, 1.0]
            if not any(axis):
                raise FileError(
                    f"{word}: expected a direction of the tool that is not zero", file=file, line=number
                )
            points.append([unit * c for c in v[:3]])
            tools.append(axis)
            feeds.append(feed)
            spindles.append(spindle)
            lines.append(number)
            rapids.append(rapid or word == "FROM")
            rapid = False
        elif word == "RAPID":
            rapid = True
        elif word == "FEDRAT":
            feed = _feedrate(values, unit, file, number)
        elif word == "SPINDL":
            spindle = _spindle(values, file, number, spindle)
        else:
            raise FileError(f"unknown word {word[:30]!r}", file=file, line=number)
    if len(points) < 2:
        raise FileError("expected two or more points (GOTO)", file=file)
    p = path_of(points, feed=feeds, spindle=spindles, tool=tools, lines=lines, name=path.stem)
    p.kind[np.array(rapids[1:])] = 0
    return p


def _feedrate(values: list[str], unit: float, file: str, line: int) -> float:
    units = {"MMPM": 1e-3 / 60, "IPM": 25.4e-3 / 60, "PERMIN": unit / 60}
    named = [v for v in values if v in units]
    rest = [v for v in values if v not in units]
    if len(rest) != 1 or len(named) > 1 or (not named and not unit):
        raise FileError("FEDRAT: expected a number with MMPM, IPM or PERMIN", file=file, line=line)
    feed = _number(rest[0], "FEDRAT", file, line) * (units[named[0]] if named else unit / 60)
    if not feed > 0:
        raise FileError("FEDRAT: expected a feed above zero", file=file, line=line)
    return feed


def _spindle(values: list[str], file: str, line: int, before: float) -> float:
    if values in (["OFF"], []):
        return 0.0
    if values == ["ON"]:
        return before
    if "CCLW" in values:
        return -1.0
    rest = [v for v in values if v not in ("CLW", "RPM", "ON")]
    if len(rest) != 1:
        raise FileError(
            "SPINDL: expected a number of revolutions per minute, CLW or OFF", file=file, line=line
        )
    return _number(rest[0], "SPINDL", file, line) * pi / 30
