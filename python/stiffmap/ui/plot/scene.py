"""Axes in which a machine is drawn: two dimensions where it lies in a plane of constant z, else three; filled by what is drawn."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.patches import Polygon
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats
from stiffmap.ui.plot.skeleton import Skeleton
from stiffmap.ui.plot.style import BLACK, MM, ORANGE

ARROW = 0.16  # of the machine's extent, length of the arrow of the force
FORCE = "#C1121F"
ZOOM = 0.94
MARGIN = 0.06
THINNEST = 0.3  # of the widest axis


def scene_axes(
    figure: Figure, shape: Skeleton, view: tuple[float, float] | None, place: SubplotSpec | int = 111
) -> Axes:
    """Axes for a machine; a `view` asks for three dimensions."""
    if view is None and shape.is_flat:
        return figure.add_subplot(place)
    space: Axes = figure.add_subplot(place, projection="3d")
    return space


def on(ax: Axes, points: ArrayLike) -> Floats:
    """Coordinates (mm) of points (n, 3) or (3,) m, one array for each dimension of the axes."""
    return np.asarray((MM * np.asarray(points, dtype=float).T)[: 3 if isinstance(ax, Axes3D) else 2])


def dots(ax: Axes, points: ArrayLike, size: float, **look: Any) -> None:
    """Marks above lines, at points (n, 3) or (3,) m."""
    if isinstance(ax, Axes3D):
        ax.scatter(*on(ax, points), s=size, depthshade=False, **look)
    else:
        x, y = on(ax, points)
        ax.scatter(x, y, s=size, zorder=4, **look)


def draw_body(ax: Axes, shape: Skeleton) -> None:
    """A platform that is a plate: its area, and from its middle to the TCP."""
    if not len(shape.plate):
        return
    corners, tool = on(ax, shape.plate).T, shape.links[-1]
    look: dict[str, Any] = {"facecolor": "0.55", "edgecolor": "0.25", "label": "platform"}
    if isinstance(ax, Axes3D):
        ax.add_collection3d(Poly3DCollection([corners], **look, alpha=0.45))
    else:
        ax.add_patch(Polygon(corners, **look, alpha=0.5, zorder=1))
    if np.linalg.norm(tool[1] - tool[0]) > 1e-6:
        ax.plot(*on(ax, tool), color=BLACK, lw=1.2, zorder=1)


def draw_skeleton(ax: Axes, s: Skeleton, colours: Mapping[str, str], *, joints: bool = True) -> None:
    """Guides, links in the colours of their legs, platform, joints, TCP."""
    for ends in s.guides:
        ax.plot(*on(ax, ends), color="0.82", lw=5, solid_capstyle="butt", zorder=1)
    named: set[str] = set()
    for leg, ends in s.bars:
        label = None if leg in named or not leg else f"leg {leg}"
        named.add(leg)
        ax.plot(*on(ax, ends), color=colours[leg], lw=2, label=label)
    if len(s.guides):
        ax.plot([], [], color="0.82", lw=5, label="travel of a drive")
    draw_body(ax, s)
    if joints:
        dots(ax, s.actuators, 32, marker="s", color=BLACK, label="actuator")
    if joints and len(s.passive):
        look: dict[str, Any] = {"facecolor": "white", "edgecolor": BLACK, "linewidth": 0.8}
        dots(ax, s.passive, 12, marker="o", label="passive joint", **look)
    dots(ax, s.tcp, 110, marker="*", color=ORANGE, edgecolor=BLACK, linewidth=0.5, label="TCP")


def box_corners(low: Floats, high: Floats) -> Floats:
    """(8, 3) corners of a box: bit i of the number says which end of axis i."""
    return np.array([[(low, high)[c >> i & 1][i] for i in range(3)] for c in range(8)])


def box_edges(low: Floats, high: Floats) -> Floats:
    """(12, 2, 3) edges of a box."""
    corners = box_corners(low, high)
    return np.array([[corners[c], corners[c | 1 << i]] for c in range(8) for i in range(3) if not c >> i & 1])


def draw_box(ax: Axes, low: Floats, high: Floats) -> None:
    """Edges of the workspace box, m."""
    label: str | None = "workspace"
    for ends in box_edges(low, high):
        if np.ptp(on(ax, ends), axis=1).any():
            ax.plot(*on(ax, ends), color="0.5", lw=0.8, ls="--", label=label)
            label = None


def draw_force(ax: Axes, tip: Floats, force: Floats, extent: float) -> None:
    """An arrow along a force (3,) N that ends at `tip` (3,) m, its length a share of the machine's extent."""
    size = float(np.linalg.norm(force))
    if not size:
        return
    arrow = ARROW * extent * np.asarray(force) / size
    look: dict[str, Any] = {"color": FORCE, "label": f"force {size:g} N"}
    start, way = on(ax, tip - arrow), on(ax, arrow)
    if isinstance(ax, Axes3D):
        ax.quiver(*start, *way, lw=2.2, arrow_length_ratio=0.3, **look)
    elif np.linalg.norm(way) > 0.0:
        ax.quiver(*start, *way, angles="xy", scale_units="xy", scale=1, width=0.012, zorder=5, **look)


def finish(ax: Axes, view: tuple[float, float] | None = None) -> None:
    """Equal scales, direction of view, labels, and limits that leave no empty room."""
    ax.set(xlabel="x, mm", ylabel="y, mm")
    if not isinstance(ax, Axes3D):
        ax.margins(MARGIN)
        ax.autoscale_view()
        ax.set_aspect("equal", adjustable="datalim")
        ax.grid(color="0.9", lw=0.5)
        ax.set_axisbelow(True)
        return
    ax.set(zlabel="z, mm", aspect="equal")
    limits = {a: np.array(getattr(ax, f"get_{a}lim")()) for a in "xyz"}
    least = THINNEST * max(float(np.ptp(v)) for v in limits.values())
    for axis, v in limits.items():
        if np.ptp(v) < least:  # room for the numbers of the axis
            getattr(ax, f"set_{axis}lim")(v.mean() - least / 2, v.mean() + least / 2)
    spans = [max(float(np.ptp(v)), least) for v in limits.values()]
    ax.set_box_aspect(spans, zoom=ZOOM)
    ax.view_init(*(view or (22.0, 35.0)))
    ax.locator_params(nbins=5)  # numbers of slanting axes would run into each other
