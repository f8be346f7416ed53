"""Everything that the figures and the statements are made of, computed once; Figures 5, 6 and 7 in the paper's arrangement."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stiffmap.common.number_text import place_text
from stiffmap.solve.machine import Machine, load_machine
from stiffmap.ui.plot.error_maps import map_figure
from stiffmap.ui.plot.forces import draw_ellipse, draw_polar, sweep_figure
from stiffmap.ui.plot.style import MM, headline, panel, paper
from stiffmap.workspace.maps import error_map, polar, sweep
from stiffmap.workspace.maps.summary import readings

POINTS = {
    "isotropic": (0.0, 0.0, 0.0),
    "near corner": (-0.2, -0.2, -0.2),
    "far corner": (0.3, 0.3, 0.3),
    "asymmetric": (-0.2, 0.3, 0.0),
}
"""The four work points of §5.3, m."""
PLANES = (-0.2, 0.0, 0.3)  # z of the error maps, m
FORCE = 300.0
TOLERANCE = 0.25e-3
LARGEST_FORCE = 1000.0
FX, FY = [FORCE, 0.0, 0, 0, 0, 0], [0.0, FORCE, 0, 0, 0, 0]


@dataclass(frozen=True)
class Results:
    """Polar diagrams, limits and sweeps at the four points, and the error maps."""

    revised: Machine
    original: Machine
    polars: dict[str, xr.Dataset]
    points: dict[str, xr.Dataset]
    """Map of one pose each: limits, extremes, Fx and Fy."""
    sweeps: dict[str, dict[str, xr.Dataset]]
    """Point -> direction of the force -> sweep."""
    maps: xr.Dataset


def compute(count: int = 101, *, threads: int | None = None, progress: bool | None = None) -> Results:
    """Results with error maps of count x count positions per plane."""
    revised, original = load_machine("orthoglide-revised"), load_machine("orthoglide-original")
    cases = {"Fx": FX, "Fy": FY}
    x, y = (np.linspace(revised.workspace[0, i], revised.workspace[1, i], count) for i in (0, 1))
    mapped = partial(error_map, revised, wrench=cases, tolerance=TOLERANCE, threads=threads)
    points = {name: mapped(x=p[0], y=p[1], z=p[2], progress=False) for name, p in POINTS.items()}
    return Results(
        revised=revised,
        original=original,
        polars={n: polar(revised, p, FORCE, threads=threads) for n, p in POINTS.items()},
        points={n: d.squeeze(("z", "y", "x")) for n, d in points.items()},
        sweeps={n: sweeps_at(revised, p, points[n]) for n, p in POINTS.items()},
        maps=mapped(x=x, y=y, z=PLANES, progress=progress),
    )


def sweeps_at(machine: Machine, position: tuple[float, ...], at: xr.Dataset) -> dict[str, xr.Dataset]:
    """Sweeps from 0 to 1000 N along x, y, and the weakest and strongest direction at 300 N."""
    worst, best = at.worst_direction_xy.item(), at.best_direction_xy.item()
    forces = np.linspace(0.0, LARGEST_FORCE, 41)
    angles = {"Fx": 0.0, "Fy": np.pi / 2, "worst": worst, "best": best}
    return {n: sweep(machine, position, [np.cos(a), np.sin(a), 0.0], forces) for n, a in angles.items()}


def figure_5(results: Results) -> Figure:
    """(a)-(d) size of the deflection against the force's direction; (e)-(h) ellipses of deflections."""
    many = list(results.polars.values())
    title = f"Figure 5. Deflection in the xy plane, mm, under a force of {FORCE:g} N"
    with paper(10.4, 5.7, title) as figure:
        for i, pol in enumerate(many):
            top: Any = figure.add_subplot(2, 4, i + 1, projection="polar")
            draw_polar(top, pol, "deflection_xy", TOLERANCE)
            top.set_title(f"{panel(i)} {place_text(pol.position.values)}")
            bottom = figure.add_subplot(2, 4, i + 5)
            draw_ellipse(bottom, pol, "xy", TOLERANCE)
            bottom.set_title(panel(i + 4), loc="left")
    return figure


def all_figures(results: Results) -> dict[str, Figure]:
    """Every figure by the name of its file; Figure 7 in four readings, since the paper does not state its force."""
    figure_6 = sweep_figure(list(results.sweeps.values()), tolerance=TOLERANCE)
    headline(figure_6, "Figure 6. Deflection against force at the four points")
    figures = {"figure5.png": figure_5(results), "figure6.png": figure_6}
    for name, how in readings(results.maps, "xy").items():
        figure = map_figure(results.maps, how.variable, case=how.case, tolerance=TOLERANCE)
        figures[f"figure7-{name}.png"] = figure
    worst = float(results.maps.worst_deflection_xy.max()) * MM
    title = f"Figure 7. {FORCE:g} N in the worst direction of the plane, up to {worst:.2f} mm"
    headline(figures["figure7-worst.png"], title)
    return figures
