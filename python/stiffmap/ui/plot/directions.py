"""The direction of the force that a worst or a best deflection belongs to, as short lines."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from stiffmap.ui.plot.isolines import halo
from stiffmap.ui.plot.planes import Planes
from stiffmap.ui.plot.style import MM

LINE: dict[str, Any] = {"pivot": "mid", "headwidth": 0, "headlength": 0, "headaxislength": 0, "width": 0.005}


def draw_directions(
    ax: Axes, ds: xr.Dataset, variable: str, how: Planes, index: int, entries: dict[str, Any]
) -> None:
    """Lines along the force, as they are seen in the panel's plane; shorter where the force leaves it."""
    name = variable.replace("_deflection", "_direction")
    if name == variable or name not in ds:
        return
    angle = ds[name].isel({how.across: index}).transpose(how.up, how.right)
    angle = angle.isel({how.up: _spread(angle.sizes[how.up]), how.right: _spread(angle.sizes[how.right])})
    first, second = ds[name].attrs["plane"]
    parts = {first: np.cos(angle.values), second: np.sin(angle.values)}
    u, v = (parts.get(a, np.zeros(angle.shape)) for a in (how.right, how.up))
    x, y = np.meshgrid(MM * angle[how.right], MM * angle[how.up])
    ax.quiver(x, y, u, v, color="white", scale=18, **LINE).set_path_effects(halo(1.8, "#444444"))
    entries["direction"] = Line2D(
        [], [], color="white", label="direction of the force", path_effects=halo(2.5, "#444444")
    )


def _spread(count: int, most: int = 9) -> Any:
    """Indices of at most nine evenly spaced grid values, none at the border."""
    if count <= most:
        return np.arange(count)
    return np.unique(np.round((np.arange(most) + 0.5) * count / most - 0.5).astype(int))
