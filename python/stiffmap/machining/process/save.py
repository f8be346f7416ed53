"""Writing process files."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from os import PathLike
from pathlib import Path
from typing import Any

from stiffmap.common.errors import FileError
from stiffmap.common.outputs import write_text
from stiffmap.common.yaml_text import text_of
from stiffmap.machining.process.description import PRESSURES, EndMill, Process
from stiffmap.machining.process.load import load_process


def save_process(
    process: Process, path: str | PathLike[str], numbers: Mapping[str, tuple[float, float, float, float]]
) -> Path:
    """Write a process with a law of chips and edges; `numbers`: value, u and ends of the 95 % interval, SI, by name.

    Raises FileError where the file cannot be written, or its numbers are none of a process.
    """
    data = _keys(process, numbers)
    try:
        load_process(data)
    except FileError as error:
        what = f"no process file can be written: {error.key}: {error.reason}"
        raise FileError(what, file=str(path)) from error
    return write_text(path, text_of(data))


def _keys(p: Process, numbers: Mapping[str, tuple[float, float, float, float]]) -> dict[str, Any]:
    """The keys of a process file."""
    t, c, law = p.tool, p.cut, {}
    assert isinstance(p.law, EndMill)
    for n, (v, u, low, high) in numbers.items():
        size, unit = (1e6, "N/mm2") if n in PRESSURES else (1e3, "N/mm")
        law[n] = {"value": f"{v / size:.6g} {unit}"}
        if u > 0:
            note = f"95 % interval {low / size:.4g} to {high / size:.4g} {unit}"
            law[n] |= {"u": f"{u / size:.3g} {unit}", "note": note}
    helix = f"{t.helix * 180 / pi:.10g} deg"
    tool: dict[str, Any] = {"diameter": _mm(t.diameter), "teeth": t.teeth, "helix": helix}
    if t.runout:
        angle = f"{t.runout_angle * 180 / pi:.10g} deg"
        tool["runout"] = {"offset": f"{1e6 * t.runout:.4g} um", "angle": angle}
    if t.stick_out:
        tool["stick_out"] = _mm(t.stick_out)
    if t.modulus:
        tool["modulus"] = f"{t.modulus / 1e9:.10g} GPa"
    radial = {} if c.side == "slot" else {"radial": _mm(c.radial)}
    return {
        "name": p.name, **({"title": p.title} if p.title else {}), "source": p.source, "tool": tool,
        "spindle": f"{p.spindle * 30 / pi:.10g} rpm", "feed": f"{60e3 * p.feed:.10g} mm/min",
        "cut": {"side": c.side, **radial, "axial": _mm(c.axial), "through": c.through}, "law": {"end_mill": law},
        **({} if p.tolerance is None else {"tolerance": _mm(p.tolerance)}),
    }  # fmt: skip


def _mm(value: float) -> str:
    return f"{1e3 * value:.10g} mm"
