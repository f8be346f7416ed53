"""Pictures of a job: the part's outline, the error over the path, the path on the machine."""

from __future__ import annotations

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

SHARE = 0.08  # of the outline's size, that the largest error takes as it is drawn
ROUND = np.arange(1, 20) / 20.5
"""Shares of the turn of an inside corner, where the wanted wall has the tool's rounding; never the half, where opposite directions cancel."""


def outline_figure(found: Milled) -> Figure:
    """The wanted wall, as it is cut and as the compensated program cuts it; errors magnified as stated, mm, axes of the part.

    Points next to sharp outside corners, which have no wall, are left out; the magnified lines end at each corner, all lines between cuts that do not touch.
    """
    job, ds = found.job, found.dataset
    off, position, has_wall = job.off @ job.place.rotation, job.points.position, job.engaged.wall
    apart = np.abs(np.diff(position, axis=0)).max(axis=1) > 1e-9
    turned = np.abs(np.diff(off, axis=0)).max(axis=1) > 1e-6
    corner = np.flatnonzero((np.diff(job.points.way) < 1e-9) & (apart | turned))
    after_corner = np.repeat(corner + 1, len(ROUND))
    one, other = off[corner], off[corner + 1]
    arc = one[:, None] + ROUND[:, None] * (other - one)[:, None]
    arc /= np.linalg.norm(arc, axis=2, keepdims=True)
    # where the walls of an outside corner meet
    sharp = (one + other) / np.maximum(1 + (one * other).sum(axis=1, keepdims=True), 0.5)
    between = np.where(has_wall[corner, None, None], arc, sharp[:, None])
    between[apart[corner]] = np.nan
    around = np.insert(off, after_corner, between.reshape(-1, 3), axis=0)
    side = job.process.tool.diameter / 2
    wanted = np.insert(position, after_corner, position[after_corner], axis=0) - side * around
    wanted = wanted[np.insert(has_wall, after_corner, True)]
    before, after = (np.where(has_wall, ds[n], np.nan) for n in ("error_normal", "error_normal_after"))
    size = float(np.ptp(position[:, :2], axis=0).max())
    factor = max(round_factor(SHARE * size, float(np.nanmax(np.abs(before), initial=0.0))), 1.0)
    unit, scale = length_unit(float(np.nanmax(np.abs(before), initial=0.0)))

    def magnified(error: Floats) -> Floats:
        wall = position + (factor * error - side)[:, None] * off
        return np.insert(MM * wall[:, :2], corner + 1, np.nan, axis=0)

    with paper(6.4, 4.8, f"Wall of the part; errors drawn {factor:g} times larger") as figure:
        ax = figure.subplots()
        ax.plot(*(MM * wanted[:, :2].T), color=BLACK, lw=1.0, label="wanted")
        cut = magnified(before)
        pieces = [cut[k : k + 2] for k in range(len(cut) - 1)]
        sizes = scale * np.abs(np.insert(before, corner + 1, np.nan)[1:])
        lines = LineCollection(pieces, array=sizes, cmap=COLOURS, linewidths=2.2)
        ax.add_collection(lines)
        ax.plot(*magnified(after).T, color=GREEN, lw=1.0, ls="--", label="compensated")
        label = f"as it is cut: size of the error across the wall, {unit}"
        figure.colorbar(lines, ax=ax, shrink=0.7, label=label)
        ax.set_aspect("equal")
        ax.autoscale_view()
        ax.set(xlabel="x of the part, mm", ylabel="y of the part, mm")
    return figure


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
        ax = scene_axes(figure, shape, None)
        draw_skeleton(ax, shape, leg_colours(job.machine.legs))
        ax.plot(*on(ax, job.position), color=BLACK, lw=1.6, label="path")
        finish(ax)
    return figure
