"""A map along one coordinate: a line."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stiffmap.ui.plot.planes import Planes
from stiffmap.ui.plot.style import BLUE, MM, TOLERANCE


def draw_line(
    figure: Figure,
    ds: xr.Dataset,
    values: xr.DataArray,
    how: Planes,
    unit: tuple[str, float],
    tolerance: float | None,
) -> None:
    """Deflection over the only coordinate that varies; positions without a value are crosses on the axis."""
    ax = figure.subplots()
    at, v = MM * values[how.right].values, unit[1] * values.values.reshape(-1)
    ax.plot(at, v, color=BLUE, marker=".", ms=3, label=str(values.name).replace("_", " "))
    if tolerance is not None:
        ax.axhline(
            unit[1] * tolerance, color=TOLERANCE, ls="--", lw=1, label=f"tolerance {MM * tolerance:g} mm"
        )
    lost = ~np.isfinite(v)
    if lost.any():
        ax.plot(at[lost], np.zeros(int(lost.sum())), "x", color="0.3", label="without a value")
    fixed = [a for a in "xyz" if a != how.right]
    where = ", ".join(f"{a} = {MM * float(values[a].values[0]):g}" for a in fixed)
    ax.set(xlabel=f"{how.right}, mm", ylabel=f"deflection, {unit[0]}", title=f"at {where} mm")
    ax.set_ylim(0, None)
