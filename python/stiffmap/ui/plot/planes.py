"""Which planes of a map are drawn, and the axes of each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from stiffmap.common.errors import StiffmapError
from stiffmap.ui.plot.style import MM

AXES = ("x", "y", "z")


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
    missing = [a for a in AXES if a not in ds.coords and a not in ds.dims]
    if missing:
        raise StiffmapError(f"the map has no coordinate {missing[0]!r}; expected a Dataset of error_map")
    for a in AXES:
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
    first = values.isel({across: [0]}).values
    same = sizes[across] > 1 and all(
        np.array_equal(values.isel({across: [i]}).values, first, equal_nan=True) for i in range(sizes[across])
    )
    at = tuple(float(v) for v in values[across].values)
    return Planes(across, right, up, at[:1] if same else at, same)
