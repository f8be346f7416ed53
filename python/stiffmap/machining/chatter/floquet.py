"""Stability by semi-discretization: the largest multiplier of a tooth period (docs/theory.md V5; Insperger and Stépán)."""

from __future__ import annotations

from collections.abc import Iterable
from math import pi
from typing import Any

import numpy as np

from stiffmap.common.broadcasting import Floats, real_number, thread_count, whole_number
from stiffmap.common.errors import StiffmapError
from stiffmap.machining.chatter.cut import GivenProcess, chips, milling_process, spindle_speed
from stiffmap.machining.chatter.modes import ToolModes, mode_rows
from stiffmap.machining.process import Process
from stiffmap.solve.compiled import multipliers

INTERVALS = 80
"""Parts of a tooth period."""


def floquet_multiplier(
    modes: ToolModes | Iterable[Any],
    process: GivenProcess,
    speed: float | str | None = None,
    depth: float | None = None,
    intervals: int = INTERVALS,
) -> float:
    """Size of the largest multiplier of a tooth period; the cut is stable below 1.

    Parameters
    ----------
    modes
        Rows (frequency Hz, damping ratio, mass kg, direction), directions in the axes feed (x), normal (y), tool (z).
    process
        Tool, law and cut: a `Process`, a name, a file or a mapping.
    speed
        Spindle, rad/s, or text such as '5000 rpm'; None: the process's.
    depth
        Along the tool, m; None: the process's.
    intervals
        Parts of a tooth period; the error falls with the square of their number.

    Raises StiffmapError for bad input. Source: docs/theory.md, V5.
    """
    p = milling_process(process)
    w = spindle_speed(speed, p)
    a = p.cut.axial if depth is None else real_number(depth, "depth", "a depth of cut in m")
    if not 0 <= a <= 1:
        raise StiffmapError(f"depth: expected a depth of cut in m, from 0 to 1, got {a:g}")
    k = whole_number(intervals, "intervals", 2, 10_000)
    return float(multiplier_map(mode_rows(modes), p, np.array([w]), np.array([a]), k, 1)[0, 0])


def multiplier_map(
    modes: ToolModes,
    process: Process,
    speed: Floats,
    depth: Floats,
    intervals: int = INTERVALS,
    threads: int | None = None,
) -> Floats:
    """(speeds, depths) of rad/s and m; `modes` in the axes of the cut."""
    period = 2 * pi / (process.tool.teeth * np.asarray(speed, dtype=float))
    return multipliers(
        2 * pi * modes.frequency, modes.ratio, modes.mass, modes.way, modes.rest,
        chips(process, intervals), period, np.ascontiguousarray(depth, dtype=float), thread_count(threads),
    )  # fmt: skip
