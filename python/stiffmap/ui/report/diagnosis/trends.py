"""Residuals over what may drive them."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import f as f_distribution

from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.identification.diagnosis.report.findings import Findings
from stiffmap.ui.plot.experiment import kept
from stiffmap.ui.plot.style import AFTER, BEFORE, MM, UM, new_figure

Driver = tuple[str, Floats]
"""Label and value of each row."""
TREND = 1e-3
"""p-value below which residuals follow a driver, over all drivers and channels."""


def trending(d: Findings) -> tuple[list[Driver], list[Driver]]:
    """Drivers that residuals follow, before or after, and the others."""
    drivers = drivers_of(d.experiment)
    read = np.flatnonzero(d.experiment.axis_read)
    level = TREND / max(2 * len(drivers) * len(read), 1)
    followed = [
        any(
            _follows(x, kept(d, r)[:, i]) < level for r in (d.residual_before, d.residual_after) for i in read
        )
        for _, x in drivers
    ]
    return [v for v, f in zip(drivers, followed, strict=True) if f], [
        v for v, f in zip(drivers, followed, strict=True) if not f
    ]


def _follows(x: Floats, y: Floats) -> float:
    """p-value of a parabola through residuals over a driver."""
    good = np.isfinite(x) & np.isfinite(y)
    columns = min(3, len(np.unique(x[good])))
    n = int(good.sum())
    if columns < 2 or n < columns + 3:
        return 1.0
    u = (x[good] - x[good].mean()) / np.ptp(x[good])
    a = np.vander(u, columns)
    left = y[good] - a @ np.linalg.lstsq(a, y[good], rcond=None)[0]
    rest, whole = float(left @ left), float(np.sum((y[good] - y[good].mean()) ** 2))
    if rest <= 0:
        return 1.0 if whole <= 0 else 0.0
    ratio = ((whole - rest) / (columns - 1)) / (rest / (n - columns))
    return float(f_distribution.sf(ratio, columns - 1, n - columns))


def trends(d: Findings, against: list[Driver]) -> Figure:
    """Residual of each channel against what may drive it."""
    axes_read = [int(i) for i in np.flatnonzero(d.experiment.axis_read)]
    channels = d.experiment.channels
    # a row per driver fits an upright page; its columns are the channels
    figure = new_figure(max(6.0, 3.0 * len(axes_read)), 1.9 * len(against) + 0.6)
    grid = figure.subplots(len(against), len(axes_read), squeeze=False, sharex="row", sharey="col")
    for row, (name, x) in enumerate(against):
        for column, axis in enumerate(axes_read):
            ax = grid[row][column]
            for values, colour, label in (
                (d.residual_before, BEFORE, "before"),
                (d.residual_after, AFTER, "after"),
            ):
                ax.plot(x, kept(d, values)[:, axis] * UM, ".", ms=3, color=colour, alpha=0.6, label=label)
            ax.axhline(0, color="0.5", lw=0.6)
            ax.set_xlabel(name, fontsize=9)
            ax.tick_params(labelsize=8)
            ax.set_ylabel(
                f"{channels[axis].name}, {'µm' if channels[axis].unit == 'm' else 'µrad'}", fontsize=9
            )
    grid[0][0].legend(fontsize=8)
    figure.suptitle("Residual: reading minus prediction")
    return figure


def drivers_of(e: Experiment) -> list[Driver]:
    out = [(f"{c}, mm", e.position[:, i] * MM) for i, c in enumerate("xyz")]
    out += [(f"f{c}, N", e.wrench[:, i]) for i, c in enumerate("xyz") if e.wrench[:, i].any()]
    out += [("order", e.order)] if e.order is not None else []
    out += [("temperature", e.temperature)] if e.temperature is not None else []
    out += (
        [("branch: 0 loading, 1 unloading", np.array([b == "unloading" for b in e.branch], float))]
        if e.branch
        else []
    )
    return out
