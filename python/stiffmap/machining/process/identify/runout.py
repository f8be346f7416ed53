"""Run-out from signals: the line at the spindle's frequency, its noise taken from one revolution to the next."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.stats import t as student

from stiffmap.common.broadcasting import Floats
from stiffmap.machining.process.description import EndMill, Process
from stiffmap.machining.process.identify.models import NAMES, Fitted
from stiffmap.machining.process.identify.table import ForceTable, Signals
from stiffmap.machining.process.revolution import revolution

LARGEST, GRID = 1.5, 16
"""Feeds per tooth, and how many run-outs are tried before the best is refined."""


@dataclass(frozen=True)
class Runout:
    """Run-out that signals show."""

    offset: float
    """m: of a tool with two teeth half the difference of their radii, with more the offset of the axis."""
    interval: tuple[float, float]
    """m, ends of the 95 % interval: scatter of the feeds, and the uncertainty of the coefficients."""


def line_power(s: Signals, frequency: float) -> tuple[float, float]:
    """N² and N⁴: squared amplitudes of both axes across the tool at a frequency less their noise, and the variance of that.

    The noise is what differs from one revolution to the next; of a single revolution it is not known (NaN).
    """
    turn = np.exp(-2j * pi * frequency * (s.time - s.time[0]))
    each = 2 * (s.force[:, :2] - s.force[:, :2].mean(axis=0)) * turn[:, None]
    count = max(round(len(s.time) * float(np.median(np.diff(s.time))) * frequency), 1)
    turns = np.stack([part.mean(axis=0) for part in np.array_split(each, count)])
    power = np.abs(turns.mean(axis=0)) ** 2
    if count < 2:
        return float(power.sum()), np.nan
    noise = (np.abs(turns - turns.mean(axis=0)) ** 2).sum(axis=0) / (count - 1) / count
    variance = 2 * np.maximum(power - noise, 0) * noise + noise**2
    return float((power - noise).sum()), float(variance.sum())


def _model_power(p: Process, law: EndMill, offset: float) -> float:
    _, force = revolution(replace(p, law=law, tool=replace(p.tool, runout=offset, runout_angle=0.0)), 180, 16)
    first = 2 * force[:, :2].T @ np.exp(-2j * pi * np.arange(len(force)) / len(force)) / len(force)
    return float((np.abs(first) ** 2).sum())


def runout_of(table: ForceTable, law: Fitted) -> Runout | None:
    """From the signals of a table and a law of chips and edges; None where it has none, or the tool has one tooth."""
    if not table.signals or any(p.tool.teeth < 2 for p in table.cuts):
        return None
    lines = [line_power(s, p.spindle / (2 * pi)) for p, s in zip(table.cuts, table.signals, strict=True)]
    measured, variance = np.array(lines).T

    def predicted(offset: float, values: Floats = law.values) -> Floats:
        mill = EndMill(**dict(zip(NAMES, map(float, values), strict=True)))
        return np.array([_model_power(p, mill, offset) for p in table.cuts])

    def misfit(offset: float) -> float:
        return float(((predicted(offset) - measured) ** 2).sum())

    grid = np.linspace(0.0, LARGEST, GRID) * float(table.chip.max())
    best = int(np.argmin([misfit(v) for v in grid]))
    bounds = (grid[max(best - 1, 0)], grid[min(best + 1, GRID - 1)])
    found = minimize_scalar(misfit, bounds=bounds, method="bounded", options={"xatol": 1e-4 * grid[1]})
    offset = float(found.x)
    # near zero the power grows with the square of the run-out, which noise may carry below zero
    at, step = predicted(offset), (0.02 * grid[1]) ** 2
    slope = (predicted(float(np.sqrt(offset**2 + step))) - at) / step
    size = float(slope @ slope)
    if not size > 0:  # no coefficient across the tool
        return None
    middle = offset**2 + float(slope @ (measured - at)) / size
    free = len(measured) - 1
    left = measured - at - slope * (middle - offset**2)
    reach = float(student.ppf(0.975, free)) * np.sqrt((left @ left) / free / size)  # feed by feed
    if np.isfinite(variance).all():  # by the noise, wider where the feeds differ by more
        birge = max(float((left**2 / np.maximum(variance, 1e-300)).mean()) * len(left) / free, 1.0)
        reach = 1.96 * np.sqrt(birge * (slope**2 @ variance)) / size
    u = np.sqrt(np.diag(law.covariance))
    moved = np.array([slope @ (predicted(offset, law.values + d) - at) / size for d in np.diag(u)])
    moved *= student.ppf(0.975, law.freedom)
    correlation = law.covariance / np.maximum(np.outer(u, u), 1e-300)
    reach = float(np.sqrt(reach**2 + moved @ correlation @ moved))
    low, high = (float(np.sqrt(max(middle + k * reach, 0.0))) for k in (-1, 1))
    return Runout(offset, (low, max(high, offset)))
