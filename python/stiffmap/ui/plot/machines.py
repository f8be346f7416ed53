"""A machine in three dimensions."""

from __future__ import annotations

from itertools import combinations, product
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats, real_array
from stiffmap.common.errors import StiffmapError
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.machine import Machine, takes_machine
from stiffmap.solve.status import Status
from stiffmap.ui.plot.scene import dimensions, draw_body, finish, flat_marks, on, scene_axes, tool
from stiffmap.ui.plot.skeleton import Skeleton, skeleton
from stiffmap.ui.plot.style import BLACK, CYCLE, MM, legend_below, new_figure, paper_style


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
    k = inverse_kinematics(machine, p, rotation)
    if int(k.status) != Status.CONVERGED:
        where = ", ".join(f"{MM * v:g}" for v in p)
        raise StiffmapError(
            f"position: {machine.name} cannot be drawn at ({where}) mm: {Status(int(k.status)).name}"
        )
    with paper_style():
        figure = new_figure(5.6, 5.2)
        shape = skeleton(machine, k.coordinates)
        ax: Any = scene_axes(figure, shape, view)
        draw_skeleton(ax, shape, machine.legs)
        if machine.description.workspace is not None:
            draw_box(ax, machine.workspace)
        finish(ax, shape, view)
        ax.set_title(f"{machine.name} at ({', '.join(f'{MM * v:g}' for v in p)}) mm", fontsize=10)
        legend_below(figure, ax.get_legend_handles_labels()[0], most=4)
    return figure


def draw_skeleton(ax: Any, s: Skeleton, legs: tuple[str, ...]) -> None:
    """Guides, links, joints, TCP."""
    colours = {leg: CYCLE[i % len(CYCLE)] for i, leg in enumerate(legs)} | {"": BLACK}
    for _, ends in s.guides:
        ax.plot(*on(ax, ends), color="0.82", lw=5, solid_capstyle="butt", zorder=1)
    named: set[str] = set()
    for leg, ends in s.links:
        label = None if leg in named or not leg else f"leg {leg}"
        named.add(leg)
        ax.plot(*on(ax, ends), color=colours[leg], lw=2, label=label)
    if s.guides:
        ax.plot([], [], color="0.82", lw=5, label="travel of a drive")
    if len(s.platform):
        draw_body(ax, s.platform)
        tool(ax, s)
    marks = flat_marks(ax)
    ax.scatter(*on(ax, s.actuators), marker="s", s=32, color=BLACK, label="actuator", **marks)
    if len(s.passive):
        ax.scatter(*on(ax, s.passive), marker="o", s=12, facecolor="white", edgecolor=BLACK, linewidth=0.8,
                   label="passive joint", **marks)  # fmt: skip
    ax.scatter(*on(ax, s.tcp), marker="*", s=110, color=CYCLE[4], edgecolor=BLACK, linewidth=0.5, label="TCP",
               **marks)  # fmt: skip


def look_from(ax: Any, shape: Skeleton, view: tuple[float, float] | None = None) -> None:
    """Direction of view, and labels of the axes that can be seen."""
    points = [MM * p for _, ends in (*shape.links, *shape.guides) for p in ends]
    flat = bool(points) and float(np.ptp(np.array(points)[:, 2])) < 1e-3
    ax.view_init(*(view or ((90.0, -90.0) if flat else (22.0, 35.0))))
    ax.set(xlabel="x, mm", ylabel="y, mm", zlabel="z, mm")
    ax.locator_params(nbins=5)  # numbers of slanting axes would run into each other
    if flat and view is None:
        ax.set_zlabel("")
        ax.set_zticks([])


def draw_box(ax: Any, box: Floats) -> None:
    """Edges of the workspace box (2, 3) m."""
    dims = dimensions(ax)
    corners = list(dict.fromkeys(product(*(MM * box.T)[:dims])))
    label: str | None = "workspace"
    for a, b in combinations(corners, 2):
        if sum(u != v for u, v in zip(a, b, strict=True)) == 1:
            ax.plot(*zip(a, b, strict=True), color="0.5", lw=0.8, ls="--", label=label)
            label = None
