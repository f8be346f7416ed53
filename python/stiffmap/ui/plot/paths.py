"""A load path with its critical points, and a buckling mode; deflection along a toolpath."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.ndimage import binary_dilation

from stiffmap.common.broadcasting import Floats, refused, whole_number
from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import place_text
from stiffmap.solve.machine import Machine
from stiffmap.solve.status import Status
from stiffmap.ui.plot.scene import dots, draw_skeleton, finish, on, scene_axes
from stiffmap.ui.plot.skeleton import Skeleton, skeleton
from stiffmap.ui.plot.style import BLACK, BLUE, CYCLE, GREEN, MM, VERMILLION, leg_colours, length_unit, paper

MARKS = {"limit": "^", "bifurcation": "X"}
HALO = "#f5c9b0"
SHARE = 0.25  # of the machine's length, of the largest motion of a drawn mode


def path_figure(path: xr.Dataset) -> Figure:
    """Force (N) against displacement along it (mm) of a `sweep` with a limit; unstable parts dashed, a
    crossing branch in another colour."""
    _check(path)
    with paper(4.6, 3.4, most=2) as figure:
        ax = figure.subplots()
        for number, colour, name in ((0, BLUE, ""), (1, GREEN, "crossing branch, ")):
            _draw_branch(ax, path.isel(step=path.branch.values == number), colour, name)
        for kind, mark in MARKS.items():
            here = path.critical_kind.values == kind
            if here.any():
                ax.plot(MM * path.critical_deflection[here], path.critical_force[here], mark,
                        color=BLACK, ms=6, ls="", label=f"{kind} point")  # fmt: skip
        ax.axhline(0, color="0.7", lw=0.6, zorder=0)
        ax.set(xlabel="displacement along the force, mm", ylabel="force, N")
        ax.set_title(f"{path.attrs['machine']}, {place_text(path.position.values)}")
    return figure


def _check(path: xr.Dataset) -> None:
    if not path.attrs.get("end"):
        raise refused("path", "the Dataset of a sweep with a limit", "another one, such as of single forces")


def _draw_branch(ax: Axes, branch: xr.Dataset, colour: str, name: str) -> None:
    if branch.sizes["step"] < 2:
        return
    x, y = MM * branch.deflection_along.values, branch.force.values
    stable = branch.status.values == Status.CONVERGED
    ax.plot(x, np.where(stable, y, np.nan), color=colour, label=f"{name}stable")
    if not stable.all():
        near = binary_dilation(~stable)  # with their neighbours, so that the lines join
        ax.plot(x, np.where(near, y, np.nan), color=VERMILLION, ls="--", label=f"{name}unstable")


def mode_figure(
    machine: Machine, path: xr.Dataset, index: int = 0, *, view: tuple[float, float] | None = None
) -> Figure:
    """A critical point of a path: the machine there (grey) and moved along the mode, largely enlarged."""
    _check(path)
    count = path.sizes.get("critical", 0)
    if not count:
        raise StiffmapError(
            "path: expected a sweep with a critical point, which a mode belongs to; found none"
        )
    index = whole_number(index, "index", 0, count - 1, f"a critical point of the path, 0 to {count - 1}")
    at = path.critical_coordinates.values[index]
    moved = at + SHARE * machine.compiled.length * path.mode.values[index]
    leg, joint = str(path.mode_leg.values[index]), str(path.mode_joint.values[index])
    with paper(5.2, 4.8, most=4) as figure:
        shape = skeleton(machine, moved)
        ax = scene_axes(figure, shape, view)
        for _, ends in skeleton(machine, at).bars:
            ax.plot(*on(ax, ends), color="0.7", lw=1.5, zorder=1)
        draw_skeleton(ax, shape, leg_colours(machine.legs))
        _mark(ax, machine, shape, moved, leg, joint)
        finish(ax, view)
        ax.set_title(
            f"{machine.name}: {path.critical_kind.values[index]} point at "
            f"{float(path.critical_force[index]):.4g} N\nmode enlarged: "
            + (f"leg {leg}, " if leg else "") + f"most in {joint}", fontsize=9,
        )  # fmt: skip
    return figure


def _mark(ax: Axes, machine: Machine, shape: Skeleton, moved: Floats, leg: str, joint: str) -> None:
    """A halo behind the leg of the mode, a ring about what moves most."""
    for of, ends in shape.bars:
        if of == leg:
            ax.plot(*on(ax, ends), color=HALO, lw=7, alpha=0.6, solid_capstyle="round", zorder=0)
    core = machine.compiled
    index = core.names.coordinates.index(joint)
    node = next(i for i, (_, c) in enumerate(core.nodes) if c == index)
    at = core.frames(moved)[0][node]
    dots(ax, at, 190, facecolor="none", edgecolor=VERMILLION, linewidth=1.8, label="moves most")


def toolpath_figure(ds: xr.Dataset, name: str) -> Figure:
    """Deflection and its components over the way."""
    with paper(6.4, 3.4, f"{name}: deflection along the toolpath") as figure:
        ax: Any = figure.subplots()
        way = MM * ds.way.values
        unit, factor = length_unit(float(np.nanmax(ds.deflection.values, initial=0.0)))
        ax.plot(way, factor * ds.deflection.values, color=BLACK, lw=1.6, label="|d|")
        for i, axis in enumerate("xyz"):
            if np.nanmax(np.abs(ds.displacement.values[:, i]), initial=0.0) > 1e-12:
                ax.plot(way, factor * ds.displacement.values[:, i], color=CYCLE[i], lw=1.0, label=f"d{axis}")
        ax.set(xlabel="way along the path, mm", ylabel=f"deflection, {unit}")
        ax.grid(color="0.9", lw=0.5)
    return figure
