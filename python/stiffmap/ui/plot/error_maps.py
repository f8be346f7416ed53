"""Error maps: one panel per plane of positions."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from stiffmap.common.errors import StiffmapError
from stiffmap.ui.plot.failed import hatch_failed
from stiffmap.ui.plot.isolines import draw_isolines, draw_tolerance, halo
from stiffmap.ui.plot.map_lines import draw_line
from stiffmap.ui.plot.planes import Planes, on_grid, planes
from stiffmap.ui.plot.style import COLOURS, MM, length_unit, panel, paper, wrench_text

TITLES = {
    "worst_deflection": "worst direction of the force",
    "best_deflection": "best direction of the force",
    "deflection": "",
}
FORCE_PLANES = ("xy", "xz", "yz")


def map_figure(
    ds: xr.Dataset,
    variable: str | None = None,
    *,
    case: str | None = None,
    tolerance: float | None = 0.25e-3,
    directions: bool = True,
    isolines: bool = True,
    limits: tuple[float, float] | None = None,
    common_scale: bool = True,
) -> Figure:
    """A map of a deflection: one panel per plane, or one line where only one coordinate varies.

    Panels stand across the axis with the fewest positions. What lies beyond `tolerance` (m) is dotted, and
    its share is written over the panel. `variable` is a deflection of `ds` (m), or a component of its displacement: ``dx``, ``dy``, ``dz`` (m),
    ``|d|`` for its norm, or one in any plane, ``d_xz``; a deflection's standard deviation, ``…_std``, where the map has
    it. None: the worst one in the
    plane in which the force turned; the deflection of a map without directions, and of ``ds.sel(case=…)``. `case` picks a load case
    where it has several. `directions`: short lines along the force of the worst or best direction.
    `isolines`: thin lines of equal deflection. `limits` of the colour scale in m; `common_scale=False` gives
    each panel its own. Raises StiffmapError where `ds` has no such variable or case.
    """
    ds = on_grid(ds)
    if case is None and "case" in ds.coords and not ds.case.dims:  # ds.sel(case=…): what is left is that case
        case = str(ds.case.values)
        variable = variable or "deflection"
    variable = default_variable(ds) if variable is None else variable
    values = pick(ds, variable, case)
    how = planes(values)
    unit, factor = length_unit(limits[1] if limits else float(np.nanmax(values.values, initial=0.0)))
    count = len(how.values)
    width = 5.2 if how.is_line else max((2.35 if common_scale else 2.9) * count + 0.9, 4.6)
    with paper(width, 3.4, title(ds, variable, case)) as figure:
        if how.is_line:
            draw_line(figure, ds, values, how, (unit, factor), tolerance)
        else:
            _panels(figure, ds, values, how, (unit, factor), tolerance, limits, common_scale,
                    variable, case, directions, isolines)  # fmt: skip
    return figure


def _panels(
    figure: Figure,
    ds: xr.Dataset,
    values: xr.DataArray,
    how: Planes,
    unit: tuple[str, float],
    tolerance: float | None,
    limits: tuple[float, float] | None,
    common_scale: bool,
    variable: str,
    case: str | None,
    directions: bool,
    isolines: bool,
) -> None:
    axes = figure.subplots(1, len(how.values), squeeze=False, sharey=True)[0]
    norm = Normalize(unit[1] * limits[0], unit[1] * limits[1]) if limits else colour_range(values, unit[1])
    for i, ax in enumerate(axes):
        plane = values.isel({how.across: i}).transpose(how.up, how.right)
        own = norm if common_scale or limits else colour_range(plane, unit[1])
        mesh = draw_plane(ax, ds, plane, how, variable, case, own, tolerance, unit)
        if isolines:
            draw_isolines(ax, plane, how, unit[1], own)
        if directions:
            draw_directions(ax, ds, variable, how, i)
        ax.set_title(f"{panel(i, len(axes))} {how.title(i)}{shares(plane.values, tolerance)}".strip())
        if not common_scale:
            figure.colorbar(mesh, ax=ax, label=colour_label(values, unit[0]), shrink=0.85)
    axes[0].set_ylabel(f"{how.up}, mm")
    if common_scale:
        figure.colorbar(mesh, ax=list(axes), label=colour_label(values, unit[0]), shrink=0.85)


def default_variable(ds: xr.Dataset) -> str:
    """The worst deflection in the plane of the turning force; of a map without directions the deflection."""
    found = [f"worst_deflection_{p}" for p in FORCE_PLANES if f"worst_deflection_{p}" in ds]
    return found[0] if found else "deflection"


def pick(ds: xr.Dataset, variable: str, case: str | None) -> xr.DataArray:
    """A deflection of one case, dims (z, y, x), the axes ascending."""
    values = component(ds, variable)
    if "case" in values.dims:
        if case is None and values.sizes["case"] == 1:
            case = str(values.case.values[0])
        if case is None or case not in values["case"].values:
            raise StiffmapError(
                f"case: expected one of {', '.join(map(str, values.case.values))}, got {case!r}"
            )
        values = values.sel(case=case)
    return on_grid(values.to_dataset(name=variable))[variable].transpose("z", "y", "x")


def component(ds: xr.Dataset, variable: str) -> xr.DataArray:
    """A deflection of the map, or of its displacement a component, the norm or that in a plane; StiffmapError."""
    if variable in ds and ds[variable].attrs.get("units") == "m":
        return ds[variable]
    axes = {"|d|": "xyz", **{f"d{a}": a for a in "xyz"}, **{f"d_{p}": p for p in FORCE_PLANES}}.get(variable)
    if axes is None or "displacement" not in ds:
        known = [str(n) for n, v in ds.data_vars.items() if v.attrs.get("units") == "m"]
        raise StiffmapError(
            f"variable: the map has no deflection {variable!r}; there are: {', '.join(known)}, |d|, dx, dy, dz, d_xy, d_xz, d_yz"
        )
    chosen = ds.displacement.sel(component=[f"d{a}" for a in axes])
    found: xr.DataArray = (
        chosen.isel(component=0, drop=True)
        if len(axes) == 1
        else (chosen**2).sum("component", skipna=False) ** 0.5
    )
    return found


def colour_range(values: xr.DataArray, factor: float = MM) -> Normalize:
    """From the least to the largest value, times `factor`."""
    v = factor * values.values[np.isfinite(values.values)]
    return Normalize(v.min(), v.max()) if v.size else Normalize(0, 1)


def shares(values: Any, tolerance: float | None) -> str:
    """How much of a panel lies beyond the tolerance (m), and has no value."""
    good = np.isfinite(values)
    words = []
    if tolerance is not None and good.any():
        words.append(f"{_percent(np.mean(values[good] > tolerance))} beyond {MM * tolerance:g} mm")
    if not good.all():
        words.append(f"{_percent(np.mean(~good))} without a value")
    return "\n" + "\n".join(words) if words else ""


def _percent(share: float) -> str:
    """Whole per cents; never 0 or 100 for what is only nearly so."""
    if 0 < share < 0.005:
        return "< 1 %"
    return "> 99 %" if 0.995 < share < 1 else f"{100 * share:.0f} %"


def draw_plane(
    ax: Axes,
    ds: xr.Dataset,
    plane: xr.DataArray,
    how: Planes,
    variable: str,
    case: str | None,
    norm: Normalize,
    tolerance: float | None,
    unit: tuple[str, float],
) -> Any:
    """One plane: colours, tolerance, hatched failures."""
    x, y, v = MM * plane[how.right].values, MM * plane[how.up].values, unit[1] * plane.values
    mesh = ax.pcolormesh(x, y, v, shading="nearest", cmap=COLOURS, norm=norm, rasterized=True)
    hatch_failed(ax, x, y, v, status_of(ds, plane, how, variable, case))
    if tolerance is not None:
        draw_tolerance(ax, x, y, v, unit[1] * tolerance, f"{MM * tolerance:g} mm")
    ax.set_aspect("equal")
    ax.set_xlabel(f"{how.right}, mm")
    return mesh


def status_of(ds: xr.Dataset, plane: xr.DataArray, how: Planes, variable: str, case: str | None) -> Any:
    """Status of each position of a plane (up, right)."""
    turned = variable.startswith(("worst_", "best_"))
    status = ds["direction_status" if turned else "status"]
    if "case" in status.dims:
        status = status.sel(case=case) if case is not None else status.isel(case=0)
    return status.sel({how.across: plane[how.across]}).transpose(how.up, how.right).values


def colour_label(values: xr.DataArray, unit: str = "mm") -> str:
    """What the colours mean."""
    name = str(values.name or "")
    if name in ("dx", "dy", "dz"):
        return f"{name}, {unit}"
    if name.endswith("_std"):
        return f"standard deviation, {unit}"
    plane = name.rpartition("_")[2]
    return f"deflection in the {plane} plane, {unit}" if plane in FORCE_PLANES else f"deflection, {unit}"


def title(ds: xr.Dataset, variable: str, case: str | None) -> str:
    """Machine, load and direction."""
    variable, deviation, _ = variable.partition("_std")
    base = variable.removesuffix("_xy").removesuffix("_xz").removesuffix("_yz")
    ending = ": standard deviation of the deflection" if deviation else ""
    if base not in TITLES or base == "deflection":
        return f"{ds.attrs['machine']}: {load_text(ds, case)}{ending}"
    return f"{ds.attrs['machine']}: {ds.attrs['turning_force_N']:g} N, {TITLES[base]}{ending}"


def load_text(ds: xr.Dataset, case: str | None) -> str:
    """The external wrench of a case in words."""
    wrench = ds.wrench
    if "case" in wrench.dims:
        wrench = wrench.sel(case=case) if case is not None else wrench.isel(case=0)
    return wrench_text(wrench.values)


LINE: dict[str, Any] = {"pivot": "mid", "headwidth": 0, "headlength": 0, "headaxislength": 0, "width": 0.005}


def draw_directions(ax: Axes, ds: xr.Dataset, variable: str, how: Planes, index: int) -> None:
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
    ax.plot([], [], color="white", label="direction of the force", path_effects=halo(2.5, "#444444"))


def _spread(count: int, most: int = 9) -> Any:
    """Indices of at most nine evenly spaced grid values, none at the border."""
    if count <= most:
        return np.arange(count)
    return np.unique(np.round((np.arange(most) + 0.5) * count / most - 0.5).astype(int))
