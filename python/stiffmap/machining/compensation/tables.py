"""Compensation tables as controllers read them, in mm, and their reader.

All hold the positioning error E_XX of ISO 230-1 (actual less commanded; for travel along x) that the controller takes off.
Signs and reference points are conventions of each control's version: try a table with a dial gauge before use.
"""

from __future__ import annotations

import re
from os import PathLike
from pathlib import Path

import numpy as np

from stiffmap.common.broadcasting import Floats, one_of
from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.common.outputs import write_text
from stiffmap.common.texts import lines_of
from stiffmap.machining.compensation.axis_errors import AxisErrors

MM = 1e3


def _about(errors: AxisErrors) -> list[str]:
    """What the table is, one line each."""
    x = errors.axis.upper()
    i = "xyz".index(errors.axis)
    at = ", ".join(
        f"{a} = {MM * v:g}" for k, (a, v) in enumerate(zip("xyz", errors.through, strict=True)) if k != i
    )
    how = "solved half way" if errors.interpolation_checked else "estimated from second differences"
    return [
        f"stiffmap: {errors.machine or 'machine'}, travel along {x} at {at} mm",
        f"E_{x}{x} of ISO 230-1, actual less commanded, mm; {len(errors.position)} positions",
        f"linear interpolation between them leaves up to {1e6 * errors.interpolation:.3f} um ({how})",
    ]


def _linuxcnc(e: AxisErrors) -> str:
    """COMP_FILE with COMP_FILE_TYPE = 0: nominal, where it is going forward, where it is going backward."""
    forward, backward = e.positioning
    lines = [f"# {line}" for line in (*_about(e), "COMP_FILE_TYPE = 0: nominal forward reverse")]
    rows = zip(e.position, e.position + forward, e.position + backward, strict=True)
    return "\n".join([*lines, *(" ".join(f"{MM * v:.7f}" for v in row) for row in rows)]) + "\n"


def _siemens(e: AxisErrors) -> str:
    """Leadscrew error compensation: the mean of both directions; the reversal value stands in a comment."""
    step = np.diff(e.position)
    if np.ptp(step) > 1e-9 * step.mean():
        raise StiffmapError("a Siemens table needs equal steps between the positions")
    x = f"AX_{e.axis.upper()}"
    mean = (e.positioning[0] + e.positioning[1]) / 2
    lines = [f"; {line}" for line in _about(e)]
    lines += [
        "; mean of both directions; a positive value moves the axis in the negative direction",
        f"; reversal value (backlash), mean: {MM * float(e.reversal.mean()):.7f} mm",
        f"; {x}: the name of the axis on this control",
        *(f"$AA_ENC_COMP[0,{k},{x}]={MM * v:.7f}" for k, v in enumerate(mean)),
        f"$AA_ENC_COMP_STEP[0,{x}]={MM * step.mean():.7f}",
        f"$AA_ENC_COMP_MIN[0,{x}]={MM * e.position[0]:.7f}",
        f"$AA_ENC_COMP_MAX[0,{x}]={MM * e.position[-1]:.7f}",
        f"$AA_ENC_COMP_IS_MODULO[0,{x}]=0",
        "M17",
    ]
    return "\n".join(lines) + "\n"


def _heidenhain(e: AxisErrors) -> str:
    """Columns of a .COM table: number, position, what the negative direction adds, value of the axis."""
    x = e.axis.upper()
    forward, backward = e.positioning
    lines = [f"; {line}" for line in _about(e)]
    lines += [f"BEGIN {x}.COM MM", f"{'NR':<5}{'AXISPOS':>14}{'BACKLASH':>14}{x:>14}"]
    rows = zip(e.position, backward - forward, forward, strict=True)
    lines += [f"{k:<5}" + "".join(f"{MM * v:>+14.7f}" for v in row) for k, row in enumerate(rows)]
    return "\n".join([*lines, "[END]"]) + "\n"


def _csv(e: AxisErrors) -> str:
    """All six errors in both directions, mm and mrad."""
    units = ("mm",) * 3 + ("mrad",) * 3
    head = [f"{e.axis}_mm"] + [
        f"{n}_{way}_{u}" for way in ("forward", "backward") for n, u in zip(e.names, units, strict=True)
    ]
    lines = [f"# {line}" for line in (*_about(e), "forward and backward: direction of arrival")]
    rows = 1e3 * np.column_stack([e.position, e.forward, e.backward])  # of m and of rad
    return "\n".join([*lines, ",".join(head), *(",".join(f"{v:.10g}" for v in row) for row in rows)]) + "\n"


FORMATS = {"csv": _csv, "linuxcnc": _linuxcnc, "siemens": _siemens, "heidenhain": _heidenhain}


def compensation_table(errors: AxisErrors, form: str) -> str:
    """Text of a table: csv, linuxcnc, siemens or heidenhain. Raises StiffmapError for another form."""
    one_of(form, FORMATS, "format")
    return FORMATS[form](errors)


def write_table(errors: AxisErrors, path: str | PathLike[str], form: str) -> Path:
    """Write a table; raises FileError where it cannot be."""
    return write_text(path, compensation_table(errors, form), encoding="ascii", errors="replace")


def read_table(path: str | PathLike[str], form: str) -> tuple[Floats, Floats, Floats]:
    """Positions (n,), errors forward (n,) and backward (n,), m, of a table in one of the forms.

    A Siemens table holds one value for both directions. Raises FileError where the text is no such table.
    """
    one_of(form, FORMATS, "format")
    text = "".join(lines_of(Path(path)))
    try:
        x, forward, backward = READERS[form](text)
    except (ValueError, IndexError, KeyError) as problem:
        raise FileError(f"no {form} table: {problem}", file=str(path)) from None
    if x.size < 2 or not (np.diff(x) > 0).all():
        raise FileError(f"no {form} table: expected two or more rising positions", file=str(path))
    return x / MM, forward / MM, backward / MM


Columns = tuple[Floats, Floats, Floats]


def _lines(text: str, comment: str) -> list[str]:
    return [line for line in (raw.split(comment)[0].strip() for raw in text.splitlines()) if line]


def _read_csv(text: str) -> Columns:
    head, *rows = _lines(text, "#")
    names = head.split(",")
    axis = names[0].partition("_")[0]
    own = f"E_{axis.upper()}{axis.upper()}"
    values = np.array([[float(v) for v in row.split(",")] for row in rows])
    at = [names.index(f"{own}_{way}_mm") for way in ("forward", "backward")]
    return values[:, 0], values[:, at[0]], values[:, at[1]]


def _read_linuxcnc(text: str) -> Columns:
    values = np.array([[float(v) for v in line.split()] for line in _lines(text, "#")])
    return values[:, 0], values[:, 1] - values[:, 0], values[:, 2] - values[:, 0]


def _read_siemens(text: str) -> Columns:
    body = "\n".join(_lines(text, ";"))
    nodes = {int(k): float(v) for k, v in re.findall(r"\$AA_ENC_COMP\[\d+,(\d+),\w+\]=(\S+)", body)}
    ends = {w: float(v) for w, v in re.findall(r"\$AA_ENC_COMP_(MIN|MAX|STEP)\[\d+,\w+\]=(\S+)", body)}
    if sorted(nodes) != list(range(len(nodes))):
        raise ValueError("values are missing")
    values = np.array([nodes[k] for k in range(len(nodes))])
    x: Floats = ends["MIN"] + ends["STEP"] * np.arange(values.size, dtype=np.float64)
    return np.asarray(x, dtype=np.float64), values, values


def _read_heidenhain(text: str) -> Columns:
    lines = _lines(text, ";")
    if not re.fullmatch(r"BEGIN \w+\.COM MM", lines[0]) or lines[-1] != "[END]":
        raise ValueError("expected BEGIN … .COM MM and [END]")
    values = np.array([[float(v) for v in line.split()] for line in lines[2:-1]])
    return values[:, 1], values[:, 3], values[:, 3] + values[:, 2]


READERS = dict(zip(FORMATS, (_read_csv, _read_linuxcnc, _read_siemens, _read_heidenhain), strict=True))
