"""Maps of the standard deviation of a deflection."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stiffmap.ui.plot.error_maps import colour_range, draw_plane, panel_row, pick, title
from stiffmap.ui.plot.map_lines import draw_line
from stiffmap.ui.plot.planes import on_grid, planes
from stiffmap.ui.plot.style import headline, legend_below, length_unit, new_figure, panel, paper_style


def deviation_figure(ds: xr.Dataset, variable: str, *, case: str | None = None) -> Figure:
    """Standard deviation of the deflection `variable` of one case, one panel per plane.

    Raises StiffmapError where `ds` has no such variable, case or standard deviation.
    """
    name = f"{variable}_std"
    ds = on_grid(ds)
    values = pick(ds, name, case)
    how = planes(values)
    unit = length_unit(float(np.nanmax(values.values, initial=0.0)))
    with paper_style():
        if how.is_line:
            figure = new_figure(5.2, 3.4)
            draw_line(figure, ds, values, how, unit, None)
        else:
            figure, axes = panel_row(len(how.values))
            norm, entries = colour_range(values, unit[1]), dict[str, Any]()
            for i, ax in enumerate(axes):
                plane = values.isel({how.across: i}).transpose(how.up, how.right)
                mesh = draw_plane(ax, ds, plane, how, name, case, norm, None, unit, entries)
                ax.set_title(f"{panel(i)} {how.title(i)}")
            axes[0].set_ylabel(f"{how.up}, mm")
            figure.colorbar(mesh, ax=list(axes), label=f"standard deviation, {unit[0]}", shrink=0.85)
            if entries:
                legend_below(figure, list(entries.values()))
        headline(figure, f"{title(ds, variable, case)}: standard deviation of the deflection")
    return figure
