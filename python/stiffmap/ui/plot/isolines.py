"""Lines of equal deflection, and what lies beyond the tolerance."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.ticker import MaxNLocator

from stiffmap.ui.plot.planes import Planes
from stiffmap.ui.plot.style import MM, TOLERANCE

FEWEST = 5
"""Positions along each axis below which isolines would say more than was computed."""


def halo(width: float, colour: str) -> list[patheffects.AbstractPathEffect]:
    """An outline that keeps a line visible on any colour."""
    return [patheffects.withStroke(linewidth=width, foreground=colour)]


def levels(low: float, high: float, most: int = 8) -> list[float]:
    """Round values inside a range."""
    return [float(t) for t in MaxNLocator(most).tick_values(low, high) if low < t < high]


def draw_isolines(ax: Axes, plane: xr.DataArray, how: Planes, factor: float, norm: Normalize) -> None:
    """Some thin labelled lines of equal deflection, on a grid that is fine enough."""
    v = factor * plane.values
    if min(v.shape) < FEWEST or not np.isfinite(v).any() or norm.vmin is None or norm.vmax is None:
        return
    inside = [t for t in levels(norm.vmin, norm.vmax, 6) if np.nanmin(v) < t < np.nanmax(v)]
    if not inside:
        return
    x, y = MM * plane[how.right].values, MM * plane[how.up].values
    lines = ax.contour(x, y, v, levels=inside, colors="white", linewidths=0.5, alpha=0.8)
    for text in ax.clabel(lines, fontsize=6, fmt="%g"):
        text.set_path_effects(halo(1.2, "#444444"))


def draw_tolerance(ax: Axes, x: Any, y: Any, v: Any, level: float, words: str) -> None:
    """Outline and dots of what lies beyond the tolerance (unit of v)."""
    finite = v[np.isfinite(v)]
    if min(v.shape) < 2 or finite.size == 0 or not finite.max() > level:
        return
    look: dict[str, Any] = {"hatch": "..", "facecolor": "none", "edgecolor": TOLERANCE, "linewidth": 0}
    beyond = ax.contourf(x, y, v, levels=[level, finite.max()], colors="none", hatches=[".."], extend="max")
    beyond.set_edgecolor(TOLERANCE)
    beyond.set_linewidth(0)
    ax.fill([], [], label=f"beyond {words}", **look)
    if finite.min() < level:
        lines = ax.contour(x, y, v, levels=[level], colors=TOLERANCE, linewidths=1.6)
        lines.set_path_effects(halo(3, "white"))
        ax.plot([], [], color=TOLERANCE, label=f"tolerance {words}")
