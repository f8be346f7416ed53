"""Efforts, speeds and powers of the drives over time, with the limits that the machine file declares."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stiffmap.ui.plot.style import CYCLE, headline, line_look, paper

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
                    for sign in (1, -1):
                        axes.axhline(
                            sign * limit, color="black" if len(limits) == 1 else colour, linewidth=0.6
                        )
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
