"""Planes of a map: which are drawn, with which axes, and what lies over their colours: lines of equal deflection, what is beyond
the tolerance, and regions without a value, hatched, with their status in the legend."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.solve.status import Status
from stiffmap.ui.plot.style import MM, TOLERANCE

AXES = ("x", "y", "z")
FEWEST = 5  # positions along each axis below which isolines would say more than was computed
LOOK: dict[Status, tuple[str, str, str]] = {
    Status.UNREACHABLE: ("unreachable", "////", "#DDDDDD"),
    Status.SINGULAR: ("singular", "....", "#FFFFFF"),
    Status.UNSTABLE: ("unstable", "\\\\\\\\", "#F2F2F2"),
    Status.NOT_CONVERGED: ("not converged", "xxxx", "#FFFFFF"),
}


@dataclass(frozen=True)
class Planes:
    """Panels along `across`, each with `right` and `up` as its axes."""

    across: str
    right: str
    up: str
    values: tuple[float, ...]
    """Position of each panel, m."""
    same: bool
    """All panels hold the same numbers, as of a planar machine: one is drawn."""

    @property
    def is_line(self) -> bool:
        """Only the axis `right` has several positions."""
        return self.up == ""

    def title(self, index: int) -> str:
        """``z = 300 mm``."""
        return f"any {self.across}" if self.same else f"{self.across} = {MM * self.values[index]:g} mm"


def on_grid(ds: xr.Dataset) -> xr.Dataset:
    """The map with x, y and z as dimensions, ascending: `ds.sel(z=0)` lacks one."""
    for a in AXES:
        if a not in ds.coords and a not in ds.dims:
            raise StiffmapError(f"the map has no coordinate {a!r}; expected a Dataset of error_map")
        if a not in ds.dims:
            ds = ds.expand_dims(a)
    return ds.sortby(list(AXES))


def planes(values: xr.DataArray) -> Planes:
    """Panels across the axis with the fewest positions (z before y before x), or one line."""
    sizes = {a: values.sizes[a] for a in AXES}
    several = [a for a in AXES if sizes[a] > 1]
    if len(several) == 1:
        return Planes("", several[0], "", (), False)
    across = min(("z", "y", "x"), key=lambda a: sizes[a])
    right, up = (a for a in AXES if a != across)
    first = values.isel({across: [0]})
    digits = 1e-9 * float(np.abs(first).max())  # beside which round-off is nothing, and which nobody sees
    same = sizes[across] > 1 and np.allclose(values, first.values, rtol=0, atol=digits, equal_nan=True)
    at = tuple(float(v) for v in values[across].values)
    return Planes(across, right, up, at[:1] if same else at, same)


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


def draw_tolerance(ax: Axes, x: Floats, y: Floats, v: Floats, level: float, words: str) -> None:
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


def hatch_failed(ax: Axes, x: Floats, y: Floats, values: Floats, status: NDArray[np.uint8]) -> None:
    """Hatch the cells (y, x) without a value."""
    for state, (name, hatch, colour) in LOOK.items():
        cells = np.isnan(values) & (status == state)
        if not cells.any():
            continue
        look: dict[str, Any] = {"edgecolor": "#555555", "hatch": hatch, "linewidth": 0}
        shown = np.ma.masked_where(~cells, cells)
        ax.pcolor(x, y, shown, shading="nearest", cmap=ListedColormap([colour]), snap=True, **look)
        ax.fill([], [], label=name, facecolor=colour, **look)
