"""Regions without a value: hatched, with their status in the legend."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.status import Status

LOOK: dict[Status, tuple[str, str, str]] = {
    Status.UNREACHABLE: ("unreachable", "////", "#DDDDDD"),
    Status.SINGULAR: ("singular", "....", "#FFFFFF"),
    Status.UNSTABLE: ("unstable", "\\\\\\\\", "#F2F2F2"),
    Status.NOT_CONVERGED: ("not converged", "xxxx", "#FFFFFF"),
}


def edges(centres: Floats) -> Floats:
    """Borders of the cells around sorted grid values."""
    if centres.size == 1:
        return np.array([centres[0] - 0.5, centres[0] + 0.5])
    middle = (centres[1:] + centres[:-1]) / 2
    first, last = centres[0] - (middle[0] - centres[0]), centres[-1] + (centres[-1] - middle[-1])
    return np.concatenate([[first], middle, [last]])


def hatch_failed(ax: Axes, x: Floats, y: Floats, values: Floats, status: NDArray[np.uint8]) -> None:
    """Hatch the cells (y, x) without a value."""
    for state, (name, hatch, colour) in LOOK.items():
        cells = np.argwhere(np.isnan(values) & (status == state))
        if len(cells) == 0:
            continue
        look: dict[str, Any] = {"facecolor": colour, "edgecolor": "#555555", "hatch": hatch, "linewidth": 0}
        ax.add_collection(PatchCollection(_rectangles(edges(x), edges(y), cells), **look))
        ax.fill([], [], label=name, **look)


def _rectangles(x: Floats, y: Floats, cells: NDArray[np.intp]) -> list[Rectangle]:
    return [Rectangle((x[j], y[i]), x[j + 1] - x[j], y[i + 1] - y[i]) for i, j in cells]
