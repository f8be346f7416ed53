"""Figures 5, 6 and 7 in the paper's arrangement."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from stiffmap.common.number_text import place_text
from stiffmap.ui.paper.results import FORCE, TOLERANCE, Results
from stiffmap.ui.plot.error_maps import map_figure
from stiffmap.ui.plot.forces import draw_ellipse, draw_polar, sweep_figure
from stiffmap.ui.plot.style import MM, headline, panel, paper


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
    for name in ("worst", "best", "Fx", "Fy"):
        variable, case = (f"{name}_deflection_xy", None) if name.islower() else ("deflection_xy", name)
        figures[f"figure7-{name}.png"] = map_figure(results.maps, variable, case=case, tolerance=TOLERANCE)
    worst = float(results.maps.worst_deflection_xy.max()) * MM
    title = f"Figure 7. {FORCE:g} N in the worst direction of the plane, up to {worst:.2f} mm"
    headline(figures["figure7-worst.png"], title)
    return figures
