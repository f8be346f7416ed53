"""The view as a picture on paper: the machine with its plane, the colour bar, and the shares."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Line3DCollection

from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import length_text, vector_text
from stiffmap.ui.plot.loaded import draw_budget
from stiffmap.ui.plot.scene import draw_box, draw_force, draw_skeleton, finish
from stiffmap.ui.plot.style import COLOURS, MM, ORANGE, TOLERANCE, headline, leg_colours, paper
from stiffmap.ui.view.colours import plane_image
from stiffmap.ui.view.moment import Moment
from stiffmap.ui.view.place import box_of
from stiffmap.ui.view.plane import PlaneMap
from stiffmap.ui.view.quantities import QUANTITIES

SHOWN = 51
"""Poses along each edge of the plane in a picture."""


def view_figure(moment: Moment) -> Figure:
    """Machine, deflected ghost, plane with isolines, and where the deflection comes from."""
    solution, rest, found = moment.solve(), moment.rest(), moment.plane(SHOWN)
    q, limits, s = QUANTITIES[moment.state.quantity], found.range, moment.state
    with paper(9.6, 5.2, most=0) as figure:
        ax: Any = figure.add_subplot(1, 2, 1, projection="3d")
        draw_box(ax, *box_of(moment.machine))
        _plane(ax, found, limits)
        _lines(ax, found.isolines(limits), "white", 0.5)
        _lines(ax, found.tolerance_lines(s.tolerance), TOLERANCE, 1.5)
        draw_skeleton(ax, rest, leg_colours(moment.machine.legs))
        _lines(ax, moment.ghost(rest, solution), ORANGE, 1.0)
        draw_force(ax, rest.tcp, np.array(s.force), rest.extent)
        finish(ax, (22, -50))
        if s.quantity != "status":
            bar = ScalarMappable(Normalize(*limits), COLOURS)
            figure.colorbar(bar, ax=ax, label=f"{q.title}, {q.unit}", shrink=0.6, location="bottom", pad=0.08)
        _shares(figure.add_subplot(1, 2, 2), moment)
        at = ", ".join(f"{MM * v:.4g}" for v in s.position)
        moved = length_text(float(np.linalg.norm(solution.displacement[:3])))
        headline(figure, f"{moment.machine.name} at ({at}) mm under {vector_text(s.force, 4)} N: the tool moves {moved} "
                         f"(orange: × {moment.magnification(rest, solution):g})")  # fmt: skip
    return figure


def _lines(ax: Any, pieces: Any, colour: str, width: float) -> None:
    if len(pieces):
        ax.add_collection3d(Line3DCollection(MM * pieces, colors=colour, linewidths=width))


def _plane(ax: Any, found: PlaneMap, limits: tuple[float, float]) -> None:
    p = MM * found.frame.poses(found.count)
    step = plane_image(found, limits)
    colours = step[:: len(step) // found.count, :: len(step) // found.count] / 255.0
    ax.plot_surface(
        p[..., 0], p[..., 1], p[..., 2], facecolors=colours, rcount=found.count, ccount=found.count, shade=False,
        antialiased=False, linewidth=0,
    )  # fmt: skip


def _shares(ax: Any, moment: Moment) -> None:
    try:
        draw_budget(ax, moment.shares())
    except StiffmapError as problem:
        ax.text(0.5, 0.5, str(problem), ha="center", wrap=True)
        ax.axis("off")
