"""Deflection against the direction of the force, in polar coordinates and as the way of the tool, and against its size; efforts of the
drives over time with their declared limits; internal wrenches of a machine that carries nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes
from numpy.typing import NDArray

from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import place_text
from stiffmap.solve.internal_wrenches import InternalWrenches
from stiffmap.solve.status import Status, status_of_one
from stiffmap.ui.plot.style import BLACK, BLUE, MM, TOLERANCE, headline, length_unit, line_look, panel, paper
from stiffmap.workspace.maps.inputs import PLANES


def polar_figure(
    diagrams: Sequence[xr.Dataset] | xr.Dataset,
    *,
    variable: str = "deflection_xy",
    tolerance: float | None = 0.25e-3,
) -> Figure:
    """One diagram per Dataset of `polar`: radius = deflection (mm), angle = direction of the force."""
    many = [diagrams] if isinstance(diagrams, xr.Dataset) else list(diagrams)
    with paper(max(2.6 * len(many) + 0.4, 4.0), 3.3) as figure:
        axes = _panels(figure, many, "angle", variable, projection="polar")
        unit, factor = length_unit(max(float(np.nanmax(p[variable].values, initial=0.0)) for p in many))
        for ax, pol in zip(axes, many, strict=True):
            draw_polar(ax, pol, variable, tolerance, factor)
        headline(figure, f"{many[0].attrs['machine']}: deflection, {unit}, under {force_text(many[0])}")
    return figure


def draw_polar(
    ax: PolarAxes, pol: xr.Dataset, variable: str, tolerance: float | None, factor: float = MM
) -> None:
    """One diagram on a polar axis; gaps where a direction failed."""
    angle, value = (np.append(pol[n].values, pol[n].values[0]) for n in ("angle", variable))
    ax.plot(angle, factor * value, color=BLUE, label=in_words(variable))
    if tolerance is not None:
        ring = np.linspace(0, 2 * np.pi, 181)
        ax.plot(ring, np.full(181, factor * tolerance), color=TOLERANCE, lw=1, ls="--",
                label=f"tolerance {MM * tolerance:g} mm")  # fmt: skip
    ax.set_ylim(0, None)
    ax.set_rlabel_position(100)
    locator: Any = ax.yaxis.get_major_locator()
    locator.base.set_params(nbins=4)
    ax.tick_params(pad=1)
    for text in ax.get_yticklabels():
        text.set_bbox({"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 0.5})


def ellipse_figure(
    diagrams: Sequence[xr.Dataset] | xr.Dataset, *, plane: str = "xy", tolerance: float | None = 0.25e-3
) -> Figure:
    """Displacement of the TCP in the plane (mm) as the force turns; one panel per Dataset of `polar`."""
    many = [diagrams] if isinstance(diagrams, xr.Dataset) else list(diagrams)
    with paper(max(2.5 * len(many) + 0.4, 4.0), 3.2) as figure:
        for ax, pol in zip(_panels(figure, many, "angle"), many, strict=True):
            draw_ellipse(ax, pol, plane, tolerance)
        headline(figure, f"{many[0].attrs['machine']}: displacement under {force_text(many[0])}")
    return figure


def draw_ellipse(ax: Axes, pol: xr.Dataset, plane: str, tolerance: float | None) -> None:
    """One ellipse with equal axes; a dot marks the displacement under a force along the first axis."""
    names = [f"d{n}" for n in plane]
    u, v = (MM * pol.displacement.sel(component=n).values for n in names)
    ax.plot(np.append(u, u[0]), np.append(v, v[0]), color=BLUE, label="displacement")
    ax.plot(u[:1], v[:1], "o", ms=4, color=BLUE, label=f"force along +{plane[0]}")
    if tolerance is not None:
        ring, r = np.linspace(0, 2 * np.pi, 181), MM * tolerance
        ax.plot(
            r * np.cos(ring), r * np.sin(ring), color=TOLERANCE, lw=1, ls="--", label=f"tolerance {r:g} mm"
        )
    ax.axhline(0, color="0.7", lw=0.5, zorder=0)
    ax.axvline(0, color="0.7", lw=0.5, zorder=0)
    ax.set_aspect("equal", adjustable="datalim")
    ax.set(xlabel=f"{names[0]}, mm", ylabel=f"{names[1]}, mm")


def sweep_figure(
    panels: xr.Dataset | Mapping[str, xr.Dataset] | Sequence[Mapping[str, xr.Dataset]],
    *,
    variable: str = "deflection_xy",
    tolerance: float | None = 0.25e-3,
) -> Figure:
    """Lines of force against deflection (mm), by label or one alone; several panels where several mappings are given.

    Unstable equilibria are drawn as open circles; failed ones leave a gap and a cross on the axis.
    """
    # a Dataset is a mapping as well
    given = {"deflection": panels} if isinstance(panels, xr.Dataset) else panels
    many = [given] if isinstance(given, Mapping) else list(given)
    with paper(max(2.3 * len(many) + 0.6, 4.0), 3.1) as figure:
        first = [next(iter(lines.values())) for lines in many]
        axes = _panels(figure, first, "deflection_along", variable)
        for ax, lines in zip(axes, many, strict=True):
            draw_sweeps(ax, lines, variable, tolerance)
        axes[0].set_ylabel(f"{in_words(variable)}, mm")
        headline(figure, f"{first[-1].attrs['machine']}: deflection against force")
    return figure


def draw_sweeps(ax: Axes, lines: Mapping[str, xr.Dataset], variable: str, tolerance: float | None) -> None:
    """The sweeps of one panel."""
    for i, (label, swp) in enumerate(lines.items()):
        look = line_look(i)
        stable = swp.status == Status.CONVERGED
        force, value = swp.force, MM * swp[variable]
        ax.plot(force, value.where(stable), label=label, **look)
        known = np.isfinite(value)
        for chosen, at, mark, size, words in (
            ((swp.status == Status.UNSTABLE) & known, value, "o", 3.5, "unstable"),
            (~known, 0.0 * force, "x", 4.0, "no equilibrium"),
        ):
            if chosen.any():
                told = f"{label}: {words}"
                ax.plot(force[chosen], at[chosen], mark, mfc="none", ms=size, color=look["color"], label=told)
    if tolerance is not None:
        ax.axhline(MM * tolerance, color=BLACK, lw=1, ls=":", label=f"tolerance {MM * tolerance:g} mm")
    ax.set_xlabel("force, N")
    ax.set_ylim(0 if min(float(s[variable].min()) for s in lines.values()) >= 0 else None, None)
    ax.margins(x=0)


def _panels(figure: Figure, many: Sequence[xr.Dataset], *needed: str, projection: str | None = None) -> Any:
    """Axes side by side, each titled by where its Dataset is, which holds what is drawn."""
    if not many or not all(set(needed) <= set(ds.variables) for ds in many):
        raise StiffmapError(f"expected Datasets of polar or sweep that hold {' and '.join(needed)}")
    axes: NDArray[np.object_] = figure.subplots(
        1, len(many), squeeze=False, subplot_kw={"projection": projection}
    )[0]
    for i, (ax, ds) in enumerate(zip(axes, many, strict=True)):
        ax.set_title(f"{panel(i, len(many))} {place_text(ds.position.values)}".strip())
    return axes


def in_words(variable: str) -> str:
    """What a deflection variable means."""
    plane = variable.rpartition("_")[2]
    return f"deflection in the {plane} plane" if plane in PLANES else "deflection"


def force_text(ds: xr.Dataset) -> str:
    """The force of a polar diagram."""
    return f"a force of {float(ds.force):g}\u00a0N"


PANELS = (("effort", "effort", "effort_margin", "peak_effort"), ("rate", "speed", "speed_margin", "peak_speed"),
          ("power", "power, W", None, None))  # fmt: skip


def efforts_figure(found: xr.Dataset) -> Figure:
    """Three panels over time, one line per drive; limits as thin lines of the same colour (of `drive_efforts`)."""
    drives = [str(d) for d in found.drive.values]
    turns = found.attrs.get("revolute", [0] * len(drives))
    with paper(6.4, 6.0) as figure:
        panels = figure.subplots(3, 1, sharex=True)
        within = False
        for axes, (name, label, margin, peak) in zip(panels, PANELS, strict=True):
            limits: dict[float, str] = {}
            for i, drive in enumerate(drives):
                look = line_look(i)
                axes.plot(found.time, found[name][:, i], label=drive, **look)
                if margin is not None:
                    limits.setdefault(round(float(found[peak][i] + found[margin][i]), 9), look["color"])
            span = float(np.abs(found[name]).max())
            for limit, colour in limits.items():
                if np.isfinite(limit) and limit < 4 * span:
                    within = True
                    thin = {"color": "black" if len(limits) == 1 else colour, "linewidth": 0.6}
                    axes.axhline(limit, **thin)
                    axes.axhline(-limit, **thin)
            axes.axhline(0, color="0.8", linewidth=0.6, zorder=0)
            axes.set_ylabel(label if margin is None else f"{label}, {_unit(turns, name == 'effort')}")
        panels[-1].set_xlabel("time, s")
        limits_told = "thin lines: declared limits" if within else "declared limits are far off"
        headline(figure, f"{found.attrs['machine']}: drives along the motion ({limits_told})")
    return figure


def _unit(turns: list[int], effort: bool) -> str:
    sliding, turning = ("N", "N·m") if effort else ("m/s", "rad/s")
    kinds = [sliding] * (not all(turns)) + [turning] * any(turns)
    return " or ".join(kinds)


def stress_figure(stress: InternalWrenches, title: str = "") -> Figure:
    """Forces (N, left) and moments (N·m, right) of every link spring at one pose, in the spring's axes."""
    status = status_of_one(stress.status, "stress", "one pose")
    told = "" if status == Status.CONVERGED else f": none, {status.name.lower()}"
    names = list(stress.springs)
    values = np.array([stress.springs[n] for n in names]).reshape(len(names), 6)
    rows = np.arange(len(names))
    with paper(6.4, 1.2 + 0.24 * len(names), (title or "internal wrenches, spring axes") + told) as figure:
        axes: Any = figure.subplots(1, 2, sharey=True)
        for ax, first, unit in zip(axes, (0, 3), ("force, N", "moment, N m"), strict=True):
            for k in range(3):
                label = f"along or about {'xyz'[k]}" if first == 0 else None
                ax.barh(rows + 0.26 * (k - 1), values[:, first + k], height=0.24, label=label,
                        color=line_look(k)["color"])  # fmt: skip
            ax.axvline(0, color="0.3", lw=0.6)
            reach = 1.1 * max(float(np.nanmax(np.abs(values[:, first : first + 3]), initial=0.0)), 1e-6)
            ax.set(xlim=(-reach, reach), xlabel=unit, yticks=rows, yticklabels=names)
        axes[0].invert_yaxis()
    return figure
