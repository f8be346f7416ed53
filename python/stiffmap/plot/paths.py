"""A load path with its critical points, and a buckling mode."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stiffmap.errors import StiffmapError
from stiffmap.machine import Machine
from stiffmap.plot.machines import draw_skeleton
from stiffmap.plot.polars import position_text
from stiffmap.plot.skeleton import skeleton
from stiffmap.plot.style import BLACK, BLUE, MM, VERMILLION, new_figure, paper_style
from stiffmap.status import Status

MARKS = {"limit": "^", "bifurcation": "X"}
SHARE = 0.25  # of the machine's length, of the largest motion of a drawn mode


def path_figure(path: xr.Dataset) -> Figure:
    """Force (N) against displacement along it (mm) of a `sweep` with a limit; unstable parts dashed."""
    if "critical" not in path.dims:
        raise StiffmapError("path: expected a sweep with a limit, got one of single forces")
    x, y = MM * path.deflection_along.values, path.force.values
    stable = path.status.values == Status.CONVERGED
    with paper_style():
        figure = new_figure(4.6, 3.4)
        ax: Any = figure.subplots()
        ax.plot(x, np.where(stable, y, np.nan), color=BLUE, label="stable")
        if not stable.all():
            ax.plot(x, _joined(y, ~stable), color=VERMILLION, ls="--", label="unstable")
        for kind, mark in MARKS.items():
            here = path.critical_kind.values == kind
            if here.any():
                ax.plot(MM * path.critical_deflection[here], path.critical_force[here], mark,
                        color=BLACK, ms=6, ls="", label=f"{kind} point")  # fmt: skip
        ax.axhline(0, color="0.7", lw=0.6, zorder=0)
        ax.set(xlabel="displacement along the force, mm", ylabel="force, N")
        ax.set_title(f"{path.attrs['machine']}, {position_text(path)}")
        figure.legend(loc="outside lower center", ncols=4)
    return figure


def _joined(values: Any, where: Any) -> Any:
    """Values where wanted and at the neighbours of wanted points, so that lines join."""
    near = where.copy()
    near[1:] |= where[:-1]
    near[:-1] |= where[1:]
    return np.where(near, values, np.nan)


def mode_figure(
    machine: Machine, path: xr.Dataset, index: int = 0, *, view: tuple[float, float] = (22.0, 35.0)
) -> Figure:
    """A critical point of a path: the machine there (grey) and moved along the mode, largely enlarged."""
    count = path.sizes.get("critical", 0)
    if not 0 <= index < count:
        raise StiffmapError(f"index: the path has {count} critical points, got {index}")
    at = path.critical_coordinates.values[index]
    moved = at + SHARE * machine._core.length * path.mode.values[index] / 1.0
    force = float(path.critical_force[index])
    with paper_style():
        figure = new_figure(5.2, 4.8)
        ax: Any = figure.add_subplot(projection="3d")
        for _, ends in skeleton(machine, at).links:
            ax.plot(*(MM * ends.T), color="0.7", lw=1.5, zorder=1)
        draw_skeleton(ax, skeleton(machine, moved), machine.legs)
        ax.set_aspect("equal")
        ax.view_init(*view)
        ax.set(xlabel="x, mm", ylabel="y, mm", zlabel="z, mm")
        moves = str(path.mode_joint.values[index])
        ax.set_title(
            f"{machine.name}: {path.critical_kind.values[index]} point at {force:.4g} N\n"
            f"mode enlarged; most in {moves}", fontsize=9,
        )  # fmt: skip
        figure.legend(loc="outside lower center", ncols=4)
    return figure
