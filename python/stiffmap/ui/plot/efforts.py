"""Efforts, speeds and powers of the drives over time, with the limits that the machine file declares; internal wrenches of a
machine that carries nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stiffmap.solve.internal_wrenches import InternalWrenches
from stiffmap.solve.status import Status, status_of_one
from stiffmap.ui.plot.style import BLUE, CYCLE, VERMILLION, headline, line_look, paper

PANELS = (("effort", "effort", "effort_margin", "peak_effort"), ("rate", "speed", "speed_margin", "peak_speed"),
          ("power", "power, W", None, None))  # fmt: skip


def efforts_figure(found: xr.Dataset) -> Figure:
    """Three panels over time, one line per drive; limits as thin lines of the same colour (of `drive_efforts`)."""
    drives = [str(d) for d in found.drive.values]
    turns = found.attrs.get("revolute", [0] * len(drives))
    with paper(6.4, 6.0) as figure:
        panels = figure.subplots(3, 1, sharex=True)
        within = False
        for axes, (name, label, margin, peak) in zip(panels, PANELS, strict=True):
            limits: dict[float, str] = {}
            for i, drive in enumerate(drives):
                colour = CYCLE[i % len(CYCLE)]
                axes.plot(found.time, found[name][:, i], label=drive, **line_look(i))
                if margin is not None:
                    limits.setdefault(round(float(found[peak][i] + found[margin][i]), 9), colour)
            span = float(np.abs(found[name]).max())
            for limit, colour in limits.items():
                if np.isfinite(limit) and limit < 4 * span:
                    within = True
                    look = {"color": "black" if len(limits) == 1 else colour, "linewidth": 0.6}
                    axes.axhline(limit, **look)
                    axes.axhline(-limit, **look)
            axes.axhline(0, color="0.8", linewidth=0.6, zorder=0)
            axes.set_ylabel(label if margin is None else f"{label}, {_unit(turns, name == 'effort')}")
        panels[-1].set_xlabel("time, s")
        limits_told = "thin lines: declared limits" if within else "declared limits are far off"
        headline(figure, f"{found.attrs['machine']}: drives along the motion ({limits_told})")
    return figure


def _unit(turns: list[int], effort: bool) -> str:
    sliding, turning = ("N", "N·m") if effort else ("m/s", "rad/s")
    kinds = [sliding] * (not all(turns)) + [turning] * any(turns)
    return " or ".join(kinds)


def stress_figure(stress: InternalWrenches, title: str = "") -> Figure:
    """Forces (N, left) and moments (N·m, right) of every link spring at one pose, in the spring's axes."""
    status = status_of_one(stress.status, "stress", "one pose")
    told = "" if status == Status.CONVERGED else f": none, {status.name.lower()}"
    names = list(stress.springs)
    values = np.array([stress.springs[n] for n in names]).reshape(len(names), 6)
    rows = np.arange(len(names))
    with paper(6.4, 1.2 + 0.24 * len(names), (title or "internal wrenches, spring axes") + told) as figure:
        axes: Any = figure.subplots(1, 2, sharey=True)
        for ax, first, unit in zip(axes, (0, 3), ("force, N", "moment, N m"), strict=True):
            for k in range(3):
                label = f"along or about {'xyz'[k]}" if first == 0 else None
                ax.barh(rows + 0.26 * (k - 1), values[:, first + k], height=0.24, label=label,
                        color=(BLUE, VERMILLION, CYCLE[2])[k])  # fmt: skip
            ax.axvline(0, color="0.3", lw=0.6)
            reach = 1.1 * max(float(np.nanmax(np.abs(values[:, first : first + 3]), initial=0.0)), 1e-6)
            ax.set(xlim=(-reach, reach), xlabel=unit, yticks=rows, yticklabels=names)
        axes[0].invert_yaxis()
    return figure
