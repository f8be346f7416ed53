"""A machine in three dimensions."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import real_array
from stiffmap.solve.machine import Machine, takes_machine
from stiffmap.ui.plot.scene import draw_box, draw_skeleton, finish, scene_axes
from stiffmap.ui.plot.skeleton import standing
from stiffmap.ui.plot.style import leg_colours, paper, place_text


@takes_machine
def machine_figure(
    machine: Machine,
    position: ArrayLike | None = None,
    *,
    rotation: ArrayLike | None = None,
    view: tuple[float, float] | None = None,
) -> Figure:
    """The machine at a commanded TCP pose (m, base axes; None: home), springs at rest.

    `view`: elevation and azimuth in deg; None: from above where everything lies in a plane of constant z,
    else (22, 35). Raises StiffmapError where the pose cannot be reached.
    """
    p = machine.description.home.p if position is None else real_array(position, "position")
    shape = standing(machine, p, rotation)
    with paper(5.6, 5.2, most=4) as figure:
        ax: Any = scene_axes(figure, shape, view)
        draw_skeleton(ax, shape, leg_colours(machine.legs))
        if machine.description.workspace is not None:
            draw_box(ax, *machine.workspace)
        finish(ax, view)
        ax.set_title(f"{machine.name} at {place_text(p)}", fontsize=10)
    return figure
