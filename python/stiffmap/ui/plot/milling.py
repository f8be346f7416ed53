"""Pictures of a job: the part's outline, the error over the path, the path on the machine."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from stiffmap.common.broadcasting import Floats
from stiffmap.machining.milling.job import Milled
from stiffmap.ui.plot.loaded import round_factor
from stiffmap.ui.plot.scene import draw_skeleton, finish, on, scene_axes
from stiffmap.ui.plot.skeleton import standing
from stiffmap.ui.plot.style import BLACK, BLUE, COLOURS, GREEN, MM, TOLERANCE, leg_colours, length_unit, paper

SHARE = 0.08
"""Of the outline's size, that the largest error takes as it is drawn."""


def outline_figure(found: Milled) -> Figure:
    """The wanted wall, as it is cut and as the compensated program cuts it; errors magnified as stated, mm, axes of the part."""
    job, ds = found.job, found.dataset
    side = found.job.process.tool.diameter / 2
    off = _back(job.off, found)
    wall = job.points.position - side * off
    before, after = ds.error_normal.values, ds.error_normal_after.values
    size = float(np.ptp(wall[:, :2], axis=0).max())
    factor = max(round_factor(SHARE * size, float(np.nanmax(np.abs(before), initial=0.0))), 1.0)
    unit, scale = length_unit(float(np.nanmax(np.abs(before), initial=0.0)))
    with paper(6.4, 4.8, f"Wall of the part; errors drawn {factor:g} times larger") as figure:
        ax: Any = figure.subplots()
        ax.plot(*(MM * wall[:, :2].T), color=BLACK, lw=1.0, label="wanted")
        cut = MM * (wall + factor * before[:, None] * off)[:, :2]
        ax.plot(*cut.T, color="0.7", lw=0.8, label="as it is cut")
        lines = LineCollection(
            [cut[k : k + 2] for k in range(len(cut) - 1)],
            array=scale * np.abs(before[1:]),
            cmap=COLOURS,
            linewidths=2.2,
        )
        ax.add_collection(lines)
        compensated = MM * (wall + factor * after[:, None] * off)[:, :2]
        ax.plot(*compensated.T, color=GREEN, lw=1.0, ls="--", label="compensated")
        figure.colorbar(lines, ax=ax, shrink=0.7, label=f"size of the error across the wall, {unit}")
        ax.set_aspect("equal")
        ax.autoscale_view()
        ax.set(xlabel="x of the part, mm", ylabel="y of the part, mm")
    return figure


def _back(vectors: Floats, found: Milled) -> Floats:
    return np.asarray(vectors @ found.job.place.rotation)


def error_figure(ds: xr.Dataset) -> Figure:
    """Errors across the wall over the way along the path; below, those of the compensated program in their own scale."""
    way = MM * ds.way.values
    unit, scale = length_unit(float(np.nanmax(np.abs(ds.error_normal.values), initial=0.0)))
    with paper(6.4, 5.0, f"{ds.attrs['machine']}, {ds.attrs['path']}, {ds.attrs['process']}") as figure:
        top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=[2, 1])
        for name, colour, dashes, words in (
            ("error_normal", BLUE, "-", "as it is cut"),
            ("error_normal_after", GREEN, "--", "compensated"),
            ("true_error_normal", BLUE, ":", "true machine, as it is cut"),
            ("true_error_normal_after", GREEN, ":", "true machine, compensated"),
        ):
            if name in ds:
                top.plot(way, scale * ds[name], color=colour, ls=dashes, label=words)
        tolerance = ds.attrs.get("tolerance")
        if tolerance is not None:
            for sign in (-1, 1):
                top.axhline(scale * sign * tolerance, color=TOLERANCE, lw=0.8, label="tolerance")
        top.axhline(0, color="0.7", lw=0.6, zorder=0)
        top.set_ylabel(f"error across the wall, {unit}\n(positive: material stays)")
        band = "error_normal_after_low" in ds
        shown = ds.error_normal_after_high if band else ds.error_normal_after
        fine, small = length_unit(float(np.nanmax(np.abs(shown.values), initial=0.0)))
        bottom.plot(way, small * ds.error_normal_after, color=GREEN, ls="--")
        if band:
            bottom.fill_between(
                way, small * ds.error_normal_after_low, small * ds.error_normal_after_high, color=GREEN, alpha=0.25,
                label="force 80 to 120 %",
            )  # fmt: skip
        bottom.axhline(0, color="0.7", lw=0.6, zorder=0)
        bottom.set(xlabel="way along the path, mm", ylabel=f"compensated, {fine}")
    return figure


def machine_path_figure(found: Milled) -> Figure:
    """The path on the machine, which stands where the error is largest."""
    job, ds = found.job, found.dataset
    worst = int(np.nanargmax(np.abs(np.nan_to_num(ds.error_normal.values))))
    shape = standing(job.machine, job.position[worst], job.rotation[worst])
    with paper(5.6, 5.2, f"{job.machine.name}: the tool where the error is largest", most=4) as figure:
        ax: Any = scene_axes(figure, shape, None)
        draw_skeleton(ax, shape, leg_colours(job.machine.legs))
        ax.plot(*on(ax, job.position), color=BLACK, lw=1.6, label="path")
        finish(ax)
    return figure
