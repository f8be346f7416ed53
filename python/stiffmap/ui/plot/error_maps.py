"""Error maps: one panel per plane of positions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.ui.plot.forces import in_words
from stiffmap.ui.plot.planes import Planes, draw_isolines, draw_tolerance, halo, hatch_failed, on_grid, planes
from stiffmap.ui.plot.style import BLUE, COLOURS, MM, TOLERANCE, length_unit, panel, paper, wrench_text
from stiffmap.workspace.maps.inputs import PLANES

TITLES = {
    "worst_deflection": "worst direction of the force",
    "best_deflection": "best direction of the force",
}


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
    if variable is None:
        turned = [f"worst_deflection_{p}" for p in PLANES if f"worst_deflection_{p}" in ds]
        variable = turned[0] if turned else "deflection"
    values = pick(ds, variable, case)
    unit, factor = length_unit(limits[1] if limits else float(np.nanmax(values.values, initial=0.0)))
    how = planes(values)
    m = Drawn(ds, variable, case, values, how, unit, factor, tolerance)
    count = len(how.values)
    width = 5.2 if how.is_line else max((2.35 if common_scale else 2.9) * count + 0.9, 4.6)
    with paper(width, 3.4, m.title) as figure:
        if how.is_line:
            draw_line(figure.subplots(), m)
            return figure
        axes = figure.subplots(1, count, squeeze=False, sharey=True)[0]
        whole = Normalize(factor * limits[0], factor * limits[1]) if limits else m.colour_range(values)
        for i, ax in enumerate(axes):
            plane = values.isel({how.across: i}).transpose(how.up, how.right)
            own = whole if common_scale or limits else m.colour_range(plane)
            mesh = draw_plane(ax, m, plane, own)
            if isolines:
                draw_isolines(ax, plane, how, factor, own)
            if directions:
                draw_directions(ax, m, i)
            ax.set_title(f"{panel(i, count)} {how.title(i)}{shares(plane.values, tolerance)}".strip())
            if not common_scale:
                figure.colorbar(mesh, ax=ax, label=m.colour_label, shrink=0.85)
        axes[0].set_ylabel(f"{how.up}, mm")
        if common_scale:
            figure.colorbar(mesh, ax=list(axes), label=m.colour_label, shrink=0.85)
    return figure


@dataclass(frozen=True, eq=False)
class Drawn:
    """A deflection of a map, and how it is drawn."""

    ds: xr.Dataset
    variable: str
    case: str | None
    values: xr.DataArray
    """(z, y, x) m."""
    how: Planes
    unit: str
    factor: float
    """From m to the unit."""
    tolerance: float | None
    """m."""

    def status(self, plane: xr.DataArray) -> NDArray[np.uint8]:
        """Status of each position of a plane (up, right)."""
        turned = self.variable.startswith(("worst_", "best_"))
        status = self._of_case(self.ds["direction_status" if turned else "status"])
        across = self.how.across
        return np.asarray(status.sel({across: plane[across]}).transpose(self.how.up, self.how.right).values)

    def _of_case(self, values: xr.DataArray) -> xr.DataArray:
        if "case" not in values.dims:
            return values
        return values.sel(case=self.case) if self.case is not None else values.isel(case=0)

    def colour_range(self, values: xr.DataArray) -> Normalize:
        """From the least to the largest value, in the unit."""
        v = self.factor * values.values[np.isfinite(values.values)]
        return Normalize(v.min(), v.max()) if v.size else Normalize(0, 1)

    @property
    def colour_label(self) -> str:
        """What the colours mean."""
        name = self.variable
        if name.endswith("_std"):
            name = "standard deviation"
        elif name not in ("dx", "dy", "dz"):
            name = in_words(name)
        return f"{name}, {self.unit}"

    @property
    def title(self) -> str:
        """Machine, load and direction."""
        variable, deviation, _ = self.variable.partition("_std")
        base = variable.removesuffix("_xy").removesuffix("_xz").removesuffix("_yz")
        ending = ": standard deviation of the deflection" if deviation else ""
        machine = self.ds.attrs["machine"]
        if base not in TITLES:
            return f"{machine}: {wrench_text(self._of_case(self.ds.wrench).values)}{ending}"
        return f"{machine}: {self.ds.attrs['turning_force_N']:g} N, {TITLES[base]}{ending}"


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
    return values.transpose("z", "y", "x")


def component(ds: xr.Dataset, variable: str) -> xr.DataArray:
    """A deflection of the map, or of its displacement a component, the norm or that in a plane; StiffmapError."""
    if variable in ds and ds[variable].attrs.get("units") == "m":
        return ds[variable]
    axes = {"|d|": "xyz", **{f"d{a}": a for a in "xyz"}, **{f"d_{p}": p for p in PLANES}}.get(variable)
    if axes is None or "displacement" not in ds:
        known = [str(n) for n, v in ds.data_vars.items() if v.attrs.get("units") == "m"]
        raise StiffmapError(
            f"variable: the map has no deflection {variable!r}; there are: {', '.join(known)}, |d|, dx, dy, dz, d_xy, d_xz, d_yz"
        )
    found: xr.DataArray = ds.displacement.sel(component=[f"d{a}" for a in axes])
    if len(axes) == 1:
        return found.squeeze("component", drop=True)
    found = (found**2).sum("component", skipna=False) ** 0.5
    return found


def shares(values: Floats, tolerance: float | None) -> str:
    """How much of a panel lies beyond the tolerance (m), and has no value."""
    good = np.isfinite(values)
    words = []
    if tolerance is not None and good.any():
        words.append(f"{_percent(float(np.mean(values[good] > tolerance)))} beyond {MM * tolerance:g} mm")
    if not good.all():
        words.append(f"{_percent(float(np.mean(~good)))} without a value")
    return "\n" + "\n".join(words) if words else ""


def _percent(share: float) -> str:
    """Whole per cents; never 0 or 100 for what is only nearly so."""
    if 0 < share < 0.005:
        return "< 1 %"
    return "> 99 %" if 0.995 < share < 1 else f"{100 * share:.0f} %"


def draw_plane(ax: Axes, m: Drawn, plane: xr.DataArray, norm: Normalize) -> QuadMesh:
    """One plane: colours, tolerance, hatched failures."""
    x, y, v = MM * plane[m.how.right].values, MM * plane[m.how.up].values, m.factor * plane.values
    mesh = ax.pcolormesh(x, y, v, shading="nearest", cmap=COLOURS, norm=norm, rasterized=True)
    hatch_failed(ax, x, y, v, m.status(plane))
    if m.tolerance is not None:
        draw_tolerance(ax, x, y, v, m.factor * m.tolerance, f"{MM * m.tolerance:g} mm")
    ax.set(aspect="equal", xlabel=f"{m.how.right}, mm")
    return mesh


def draw_line(ax: Axes, m: Drawn) -> None:
    """Deflection over the only coordinate that varies; positions without a value are crosses on the axis."""
    along = m.how.right
    at, v = MM * m.values[along].values, m.factor * m.values.values.reshape(-1)
    ax.plot(at, v, color=BLUE, marker=".", ms=3, label=m.variable.replace("_", " "))
    if m.tolerance is not None:
        level, words = m.factor * m.tolerance, f"tolerance {MM * m.tolerance:g} mm"
        ax.axhline(level, color=TOLERANCE, ls="--", lw=1, label=words)
    lost = ~np.isfinite(v)
    if lost.any():
        ax.plot(at[lost], np.zeros(int(lost.sum())), "x", color="0.3", label="without a value")
    where = ", ".join(f"{a} = {MM * float(m.values[a].values[0]):g}" for a in "xyz" if a != along)
    ax.set(xlabel=f"{along}, mm", ylabel=f"deflection, {m.unit}", title=f"at {where} mm")
    ax.set_ylim(0, None)


LINE: dict[str, Any] = {"pivot": "mid", "headwidth": 0, "headlength": 0, "headaxislength": 0, "width": 0.005}


def draw_directions(ax: Axes, m: Drawn, index: int) -> None:
    """Lines along the force, as they are seen in the panel's plane; shorter where the force leaves it."""
    name, how = m.variable.replace("_deflection", "_direction"), m.how
    if name == m.variable or name not in m.ds:
        return
    angle = m.ds[name].isel({how.across: index}).transpose(how.up, how.right)
    angle = angle.isel({how.up: _spread(angle.sizes[how.up]), how.right: _spread(angle.sizes[how.right])})
    first, second = m.ds[name].attrs["plane"]
    parts = {first: np.cos(angle.values), second: np.sin(angle.values)}
    u, v = (parts.get(a, np.zeros(angle.shape)) for a in (how.right, how.up))
    x, y = np.meshgrid(MM * angle[how.right], MM * angle[how.up])
    ax.quiver(x, y, u, v, color="white", scale=18, **LINE).set_path_effects(halo(1.8, "#444444"))
    ax.plot([], [], color="white", label="direction of the force", path_effects=halo(2.5, "#444444"))


def _spread(count: int) -> NDArray[np.intp]:
    """Indices of at most nine evenly spaced grid values, none at the border."""
    most = min(count, 9)
    return np.unique(np.round((np.arange(most) + 0.5) * count / most - 0.5).astype(int))
