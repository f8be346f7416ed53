"""Maps of the standard deviation of a deflection."""

from __future__ import annotations

from typing import Any

import xarray as xr
from matplotlib.figure import Figure

from stiffmap.plot.error_maps import colour_range, draw_plane, pick, title
from stiffmap.plot.style import MM, new_figure, panel, paper_style


def deviation_figure(ds: xr.Dataset, variable: str, *, case: str | None = None) -> Figure:
    """Standard deviation (mm) of the deflection `variable` of one case, one panel per z-plane.

    Raises StiffmapError where `ds` has no such variable, case or standard deviation.
    """
    name = f"{variable}_std"
    values = pick(ds, name, case)
    with paper_style():
        n = values.sizes["z"]
        figure = new_figure(max(2.35 * n + 0.9, 4.6), 3.1)
        axes = figure.subplots(1, n, squeeze=False, sharey=True)[0]
        norm, entries = colour_range(values), dict[str, Any]()
        for i, ax in enumerate(axes):
            mesh = draw_plane(ax, ds, values.isel(z=i), name, case, norm, None, entries)
            ax.set_title(f"{panel(i)} z = {MM * float(values.z[i]):g} mm")
        axes[0].set_ylabel("y, mm")
        figure.colorbar(mesh, ax=list(axes), label="standard deviation, mm", shrink=0.85)
        if entries:
            figure.legend(handles=list(entries.values()), loc="outside lower center", ncols=len(entries))
        figure.suptitle(f"{title(ds, variable, case)}: standard deviation of the deflection", fontsize=10)
    return figure
