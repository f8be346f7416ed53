"""Figures 5, 6 and 7 in the paper's arrangement."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from stiffmap.ui.paper.results import FORCE, TOLERANCE, Results
from stiffmap.ui.plot.error_maps import map_figure
from stiffmap.ui.plot.forces import draw_ellipse, draw_polar, position_text, sweep_figure
from stiffmap.ui.plot.style import MM, headline, panel, paper


def figure_5(results: Results) -> Figure:
    """(a)-(d) size of the deflection against the force's direction; (e)-(h) ellipses of deflections."""
    many = list(results.polars.values())
    title = f"Figure 5. Deflection in the xy plane, mm, under a force of {FORCE:g} N"
    with paper(10.4, 5.7, title) as figure:
        for i, pol in enumerate(many):
            top: Any = figure.add_subplot(2, 4, i + 1, projection="polar")
            draw_polar(top, pol, "deflection_xy", TOLERANCE)
            top.set_title(f"{panel(i)} {position_text(pol)}")
            bottom = figure.add_subplot(2, 4, i + 5)
            draw_ellipse(bottom, pol, "xy", TOLERANCE)
            bottom.set_title(panel(i + 4), loc="left")
    return figure


def figure_6(results: Results) -> Figure:
    """Force against deflection at the four points."""
    figure = sweep_figure(list(results.sweeps.values()), tolerance=TOLERANCE)
    headline(figure, "Figure 6. Deflection against force at the four points")
    return figure


def figure_7(results: Results, variable: str = "worst_deflection_xy", case: str | None = None) -> Figure:
    """Error maps of the three planes."""
    return map_figure(results.maps, variable, case=case, tolerance=TOLERANCE)


def all_figures(results: Results) -> dict[str, Figure]:
    """Every figure by the name of its file; Figure 7 in four readings, since the paper does not state its force."""
    worst = float(results.maps.worst_deflection_xy.max()) * MM
    figures = {
        "figure5.png": figure_5(results),
        "figure6.png": figure_6(results),
        "figure7-worst.png": figure_7(results),
        "figure7-best.png": figure_7(results, "best_deflection_xy"),
        "figure7-Fx.png": figure_7(results, "deflection_xy", "Fx"),
        "figure7-Fy.png": figure_7(results, "deflection_xy", "Fy"),
    }
    headline(
        figures["figure7-worst.png"],
        f"Figure 7. {FORCE:g} N in the worst direction of the plane, up to {worst:.2f} mm",
    )
    return figures
