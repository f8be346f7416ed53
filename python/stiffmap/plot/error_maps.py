"""Error maps of z-planes."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from stiffmap.errors import StiffmapError
from stiffmap.plot.failed import hatch_failed
from stiffmap.plot.style import COLOURS, MM, TOLERANCE, new_figure, panel, paper_style

TITLES = {
    "worst_deflection": "worst direction of the force",
    "best_deflection": "best direction of the force",
    "deflection": "",
}


def map_figure(
    ds: xr.Dataset,
    variable: str = "worst_deflection_xy",
    *,
    case: str | None = None,
    tolerance: float | None = 0.25e-3,
    directions: bool = True,
    limits: tuple[float, float] | None = None,
) -> Figure:
    """One map per z-plane with a common colour scale, the tolerance (m) as a contour line.

    `variable` is a deflection of `ds` (m); `case` picks a load case where it has several.
    `directions`: short lines along the force of the worst or best direction. `limits` of the colour
    scale in m. Raises StiffmapError where `ds` has no such variable or case.
    """
    values = pick(ds, variable, case)
    with paper_style():
        n = values.sizes["z"]
        figure = new_figure(max(2.35 * n + 0.9, 4.6), 3.1)
        axes = figure.subplots(1, n, squeeze=False, sharey=True)[0]
        norm = Normalize(MM * limits[0], MM * limits[1]) if limits else colour_range(values)
        entries: dict[str, Any] = {}
        for i, ax in enumerate(axes):
            mesh = draw_plane(ax, ds, values.isel(z=i), variable, case, norm, tolerance, entries)
            if directions:
                draw_directions(ax, ds, variable, i, entries)
            ax.set_title(f"{panel(i)} z = {MM * float(values.z[i]):g} mm")
        axes[0].set_ylabel("y, mm")
        figure.colorbar(mesh, ax=list(axes), label=colour_label(values), shrink=0.85)
        if entries:
            figure.legend(handles=list(entries.values()), loc="outside lower center", ncols=len(entries))
        figure.suptitle(title(ds, variable, case), fontsize=10)
    return figure


def pick(ds: xr.Dataset, variable: str, case: str | None) -> xr.DataArray:
    """A deflection of one case, dims (z, y, x), the axes ascending."""
    if variable not in ds or ds[variable].attrs.get("units") != "m":
        raise StiffmapError(f"variable: the map has no deflection {variable!r}")
    values = ds[variable]
    if "case" in values.dims:
        if case is None or case not in values["case"]:
            raise StiffmapError(
                f"case: expected one of {', '.join(map(str, values.case.values))}, got {case!r}"
            )
        values = values.sel(case=case)
    return values.sortby(["z", "y", "x"])


def colour_range(values: xr.DataArray) -> Normalize:
    """From the least to the largest value (mm)."""
    v = MM * values.values[np.isfinite(values.values)]
    return Normalize(v.min(), v.max()) if v.size else Normalize(0, 1)


def draw_plane(
    ax: Axes,
    ds: xr.Dataset,
    plane: xr.DataArray,
    variable: str,
    case: str | None,
    norm: Normalize,
    tolerance: float | None,
    entries: dict[str, Any],
) -> Any:
    """One plane: colours, tolerance line, hatched failures; adds to the legend's entries."""
    x, y, v = MM * plane.x.values, MM * plane.y.values, MM * plane.values
    mesh = ax.pcolormesh(x, y, v, shading="nearest", cmap=COLOURS, norm=norm, rasterized=True)
    name = "status" if variable.startswith("deflection") else "direction_status"
    status = ds[name] if "case" not in ds[name].dims else ds[name].sel(case=case)
    for entry in hatch_failed(ax, x, y, v, status.sel(z=plane.z, y=plane.y, x=plane.x).values):
        entries[str(entry.get_label())] = entry
    if tolerance is not None and draw_tolerance(ax, x, y, v, MM * tolerance):
        entries["tolerance"] = Line2D([], [], color=TOLERANCE, label=f"tolerance {MM * tolerance:g} mm")
    ax.set_aspect("equal")
    ax.set_xlabel("x, mm")
    return mesh


def draw_tolerance(ax: Axes, x: Any, y: Any, v: Any, level: float) -> bool:
    """The contour line of the tolerance (mm), where it passes through the plane."""
    finite = v[np.isfinite(v)]
    if min(v.shape) < 2 or finite.size == 0 or not finite.min() < level < finite.max():
        return False
    lines = ax.contour(x, y, v, levels=[level], colors=TOLERANCE, linewidths=1.6)
    lines.set_path_effects(halo(3, "white"))
    return True


def halo(width: float, colour: str) -> list[patheffects.AbstractPathEffect]:
    """An outline that keeps a line visible on any colour."""
    return [patheffects.withStroke(linewidth=width, foreground=colour)]


def draw_directions(ax: Axes, ds: xr.Dataset, variable: str, index: int, entries: dict[str, Any]) -> None:
    """Short lines along the force of each direction that a worst or best deflection belongs to."""
    name = variable.replace("_deflection", "_direction")
    if name == variable or name not in ds or not variable.endswith(("deflection", "_xy")):
        return
    angle = ds[name].sortby(["z", "y", "x"]).isel(z=index)
    angle = angle.isel(y=_spread(angle.sizes["y"]), x=_spread(angle.sizes["x"]))
    x, y = np.meshgrid(MM * angle.x, MM * angle.y)
    look: dict[str, Any] = {
        "pivot": "mid",
        "headwidth": 0,
        "headlength": 0,
        "headaxislength": 0,
        "width": 0.005,
    }
    arrows = ax.quiver(x, y, np.cos(angle), np.sin(angle), color="white", scale=18, **look)
    arrows.set_path_effects(halo(1.8, "#444444"))
    line = Line2D([], [], color="white", label="direction of the force", path_effects=halo(2.5, "#444444"))
    entries["direction"] = line


def _spread(count: int, most: int = 9) -> Any:
    """Indices of at most nine evenly spaced grid values, none at the border."""
    if count <= most:
        return np.arange(count)
    return np.unique(np.round((np.arange(most) + 0.5) * count / most - 0.5).astype(int))


def colour_label(values: xr.DataArray) -> str:
    """What the colours mean."""
    plane = values.name and str(values.name).rpartition("_")[2]
    return f"deflection in the {plane} plane, mm" if plane in ("xy", "xz", "yz") else "deflection, mm"


def title(ds: xr.Dataset, variable: str, case: str | None) -> str:
    """Machine, load and direction."""
    base = variable.removesuffix("_xy").removesuffix("_xz").removesuffix("_yz")
    if base == "deflection":
        return f"{ds.attrs['machine']}: {load_text(ds, case)}"
    return f"{ds.attrs['machine']}: {ds.attrs['turning_force_N']:g} N, {TITLES[base]}"


def load_text(ds: xr.Dataset, case: str | None) -> str:
    """The external wrench of a case in words."""
    wrench = ds.wrench.sel(case=case) if "case" in ds.wrench.dims else ds.wrench
    names = zip(wrench.wrench_component.values, wrench.values, strict=True)
    parts = [f"{n} = {v:g} {'N' if n.startswith('f') else 'N m'}" for n, v in names if v]
    return ", ".join(parts) or "no wrench"
