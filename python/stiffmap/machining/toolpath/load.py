"""Paths by built-in name or from a file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import isfinite, nan, pi
from os import PathLike
from pathlib import Path
from typing import NoReturn

import numpy as np

from stiffmap.common.broadcasting import Floats, given_path
from stiffmap.common.errors import FileError, refuse_folder, suggestion
from stiffmap.common.number_text import number_in
from stiffmap.common.tables.named import Known, read_named
from stiffmap.common.tables.table_file import refuse_options
from stiffmap.common.tables.workbook import TABLES
from stiffmap.common.texts import lines_of
from stiffmap.machining.toolpath.gcode.load import load_gcode
from stiffmap.machining.toolpath.gcode.words import OWN_LANGUAGE
from stiffmap.machining.toolpath.outlines import outline, outline_names
from stiffmap.machining.toolpath.path import Toolpath, path_of

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
    a CL file of APT (.cl, .apt …) or a table of points (.csv), a `TableFile` as well.

    feed (m/s) and spindle (rad/s): of a built-in outline. offsets: work offsets of G-code by name, m. progress: called with the number of lines read. Raises FileError.
    """
    given_path(name_or_file, "path", "a file or the name of a built-in outline")
    if offsets and Path(name_or_file).suffix.lower() not in GCODE:
        raise FileError("offsets: only a program in G-code takes them", file=str(name_or_file))
    if str(name_or_file) in outline_names():
        refuse_options(name_or_file, "an outline")
        speeds = {"feed": feed, "rpm": None if spindle is None else spindle * 30 / pi}
        return outline(str(name_or_file), size, **{k: v for k, v in speeds.items() if v is not None})
    path = Path(name_or_file)
    refuse_folder(name_or_file, "the file of a path or a built-in outline")
    if not path.is_file():
        raise FileError(
            f"no such file, and no built-in outline of that name{suggestion(path.stem, outline_names())}; "
            f"these are: {', '.join(outline_names())}",
            file=str(name_or_file),
        )
    if size is not None:
        raise FileError("size: only a built-in outline takes one", file=str(path))
    suffix = path.suffix.lower()
    if suffix in TABLES:
        return read_points(name_or_file)
    refuse_options(name_or_file, f"a path of the kind {suffix}")
    if suffix in GCODE:
        return load_gcode(path, offsets=offsets, progress=progress)
    if suffix in CL:
        return read_cl(path)
    known = ", ".join((*GCODE, *CL, *TABLES))
    raise FileError(f"unknown kind of path {suffix!r}; known: {known}; {OWN_LANGUAGE}", file=str(path))


COLUMNS = {
    **dict.fromkeys("xyz", "m"), "feed": "m/s", "spindle": "rad/s", **dict.fromkeys("ijk", ""), "turn": "rad",
}  # fmt: skip
USUAL = {**{a: f"{a}_mm" for a in "xyz"}, "feed": "feed_mm_min", "spindle": "spindle_rpm", "turn": "turn_deg"}
SPELLED = {"spindle": "s|drehzahl", "feed": "f|feed_?rate|velocity|vorschub"}


def read_points(path: str | PathLike[str]) -> Toolpath:
    """Rows x_mm, y_mm, z_mm (or ``x [mm]`` …), and where given feed_mm_min, spindle_rpm, i, j, k (tool axis), turn_deg.

    Raises FileError naming the column or the line.
    """
    t = read_named(path, Known(COLUMNS, USUAL, SPELLED, aside="t|time|zeit", titled="z"))
    n = len(t.lines)
    if n < 2:
        t.fail("expected a line of names and two or more points")
    if missing := [a for a in "xyz" if a not in t.values]:
        t.fail(f"missing column {missing[0]}_mm")
    for name in "xyz":
        t.check(name, lambda v: np.abs(v) <= 1e9, "a number of at most 1e9")
    t.check("feed", lambda v: v > 0, "a feed above zero")
    t.check("spindle", lambda v: v > 0, "a speed above zero: the spindle is off in a cut")
    axes = [a for a in "ijk" if a in t.values]
    if axes and len(axes) < 3:
        t.fail("the tool's axis needs the columns i, j and k")
    tool: Floats = t.block("ijk") if axes else np.array([0.0, 0.0, 1.0])
    none = np.flatnonzero(~np.atleast_2d(tool).any(axis=1))
    if none.size:
        t.fail("expected a direction of the tool that is not zero", "i", int(none[0]))
    unknown = np.full(n, nan)
    return path_of(
        t.block("xyz"), feed=t.values.get("feed", unknown), spindle=t.values.get("spindle", unknown), tool=tool,
        lines=np.array(t.lines), name=Path(path).stem, turn=t.values.get("turn"),
    )  # fmt: skip


SILENT = (
    "PARTNO", "PPRINT", "REMARK", "TOOLNO", "LOADTL", "LOAD", "CUTTER", "COOLNT", "MACHIN", "CLRSRF", "STOP", "OPSTOP", "DELAY",
    "TOOL PATH", "TLDATA", "PAINT", "END-OF-PATH",
)  # fmt: skip
TEXTS = ("PARTNO", "PPRINT", "REMARK", "TPRINT")
"""Words that text follows, with or without a slash."""
ENDS = ("FINI", "END", "REWIND")
UNITS = {"MM": 1e-3, "INCHES": 25.4e-3, "INCH": 25.4e-3, "CM": 1e-2}
Fail = Callable[[str], NoReturn]


def read_cl(path: Path) -> Toolpath:
    """A CL file of APT: UNITS, GOTO (with the tool's axis where it has six numbers, which holds until the next), FROM, FEDRAT, RAPID, SPINDL.

    Raises FileError naming the line; what is not understood is refused.
    """
    unit, feed, spindle, rapid = 0.0, nan, nan, False
    number, pending, remark = 0, "", False
    axis: list[float] | None = [0.0, 0.0, 1.0]
    origin: list[str] = []
    rows: list[tuple[list[float], list[float], float, float, int, bool]] = []

    def fail(message: str) -> NoReturn:
        raise FileError(message, file=str(path), line=number)

    for number, raw in enumerate(lines_of(path), 1):
        if remark := remark or raw.startswith("$$->"):  # these of Creo go on behind a $, as a statement does
            remark = raw.rstrip().endswith("$")
            continue
        text = pending + raw.split("$$")[0].strip()
        if text.endswith("$"):
            pending = text[:-1]
            continue
        pending = ""
        word, _, rest = text.partition("/")
        word, values = word.strip().upper(), [v.strip().upper() for v in rest.split(",")]
        if not word or word in SILENT or word.split()[0] in TEXTS:
            continue
        if word in ENDS:
            break
        if word == "UNITS":
            if values[0] not in UNITS:
                fail(f"UNITS: expected MM or INCHES, found {rest[:20]!r}")
            unit = UNITS[values[0]]
        elif word in ("GOTO", "FROM"):
            if not unit:
                fail("the unit is missing: expected UNITS/MM before the first point")
            v = [_number(t, word, fail) for t in values]
            if len(v) not in (3, 6):
                fail(f"{word}: expected 3 or 6 numbers, found {len(v)}")
            axis = v[3:] or axis
            if axis is None:
                fail(f"{word}: expected 6 numbers, since MULTAX/OFF came with the tool tilted; found 3")
            if not any(axis):
                fail(f"{word}: expected a direction of the tool that is not zero")
            rows.append(([unit * c for c in v[:3]], axis, feed, spindle, number, rapid or word == "FROM"))
            rapid = False
        elif word == "RAPID":
            rapid = True
        elif word == "FEDRAT":
            feed = _feedrate(values, unit, fail)
        elif word == "SPINDL":
            spindle = _spindle(values, spindle, fail)
        elif word == "MULTAX":
            axis = None if values == ["OFF"] and axis and any(axis[:2]) else axis
        elif word == "MSYS":
            if origin and values != origin:
                fail("MSYS: a second origin or other axes; expected one file for each")
            origin = values
        elif word == "CIRCLE":
            fail("CIRCLE: expected lines (GOTO): let the CAM system write arcs as lines")
        elif values != ["OFF"]:  # which ends what would be refused
            fail(f"unknown word {word[:30]!r}")
    if len(rows) < 2:
        raise FileError("expected two or more points (GOTO)", file=str(path))
    points, tools, feeds, spindles, lines, rapids = zip(*rows, strict=True)
    p = path_of(points, feed=feeds, spindle=spindles, tool=tools, lines=lines, name=path.stem)
    p.kind[np.array(rapids[1:])] = 0
    return p


def _number(text: str, column: str, fail: Fail) -> float:
    try:
        value = number_in(text)
    except ValueError:
        value = nan
    if not isfinite(value) or abs(value) > 1e9:
        fail(f"{column}: expected a number, found {text[:30]!r}")
    return value


def _feedrate(values: list[str], unit: float, fail: Fail) -> float:
    units = {"MMPM": 1e-3 / 60, "IPM": 25.4e-3 / 60, "PERMIN": unit / 60}
    named = [v for v in values if v in units]
    rest = [v for v in values if v not in units]
    if len(rest) != 1 or len(named) > 1 or (not named and not unit):
        fail("FEDRAT: expected a number with MMPM, IPM or PERMIN")
    feed = _number(rest[0], "FEDRAT", fail) * (units[named[0]] if named else unit / 60)
    if not feed > 0:
        fail("FEDRAT: expected a feed above zero")
    return feed


def _spindle(values: list[str], before: float, fail: Fail) -> float:
    if values in (["OFF"], [""]):
        return 0.0
    if values == ["ON"]:
        return before
    if "CCLW" in values:
        return -1.0
    rest = [v for v in values if v not in ("CLW", "RPM", "ON")]
    if len(rest) != 1:
        fail("SPINDL: expected a number of revolutions per minute, CLW or OFF")
    return _number(rest[0], "SPINDL", fail) * pi / 30
