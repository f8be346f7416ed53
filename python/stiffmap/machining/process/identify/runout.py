"""Run-out from signals: the line at the spindle's frequency against that of the tooth passing."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi

import numpy as np
from scipy.optimize import minimize_scalar

from stiffmap.common.broadcasting import Floats
from stiffmap.machining.process.description import EndMill, Process
from stiffmap.machining.process.identify.table import ForceTable, Signals
from stiffmap.machining.process.revolution import revolution

LARGEST, GRID = 1.5, 16
"""Feeds per tooth, and how many run-outs are tried before the best is refined."""


@dataclass(frozen=True, eq=False)
class Runout:
    """Run-out that signals show."""

    offset: float
    """m: of a tool with two teeth half the difference of their radii, with more the offset of the axis."""
    lines: Floats
    """(n, 2) N: amplitudes at the spindle's and the tooth-passing frequency, both axes across the tool together."""
    predicted: Floats
    """(n, 2) N, of the law with that run-out."""


def line(s: Signals, frequency: float) -> Floats:
    """(3,) N, amplitude at a frequency."""
    turn = np.exp(-2j * pi * frequency * (s.time - s.time[0]))
    return np.asarray(2 * np.abs((s.force - s.force.mean(axis=0)).T @ turn) / len(s.time))


def _model_lines(p: Process) -> tuple[float, float]:
    _, force = revolution(p, 180, 16)
    spectrum = 2 * np.abs(np.fft.rfft(force[:, :2], axis=0)) / len(force)
    sizes = np.linalg.norm(spectrum, axis=1)
    return float(sizes[1]), float(sizes[p.tool.teeth])


def runout_of(table: ForceTable, law: EndMill) -> Runout | None:
    """From the signals of a table; None where it has none, or the tool has one tooth."""
    if not table.signals or any(p.tool.teeth < 2 for p in table.cuts):
        return None
    lines = []
    for p, s in zip(table.cuts, table.signals, strict=True):
        turn = p.spindle / (2 * pi)
        both = [float(np.linalg.norm(line(s, f)[:2])) for f in (turn, p.tool.teeth * turn)]
        lines.append(both)
    measured = np.array(lines)
    cuts = [replace(p, law=law) for p in table.cuts]

    def predicted(offset: float) -> Floats:
        return np.array(
            [_model_lines(replace(p, tool=replace(p.tool, runout=offset, runout_angle=0.0))) for p in cuts]
        )

    def misfit(offset: float) -> float:
        return float(((predicted(offset)[:, 0] - measured[:, 0]) ** 2).sum())

    grid = np.linspace(0.0, LARGEST, GRID) * float(table.chip.max())
    best = int(np.argmin([misfit(v) for v in grid]))
    found = minimize_scalar(
        misfit,
        bounds=(grid[max(best - 1, 0)], grid[min(best + 1, GRID - 1)]),
        method="bounded",
        options={"xatol": 1e-3 * grid[1]},
    )
    return Runout(float(found.x), measured, predicted(float(found.x)))
