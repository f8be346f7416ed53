"""Axes in which a machine is drawn: two dimensions where it lies in a plane of constant z, else three; filled by what is drawn."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.patches import Polygon
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats
from stiffmap.ui.plot.skeleton import Skeleton, plate
from stiffmap.ui.plot.style import BLACK, MM

FLAT = 1e-6  # m
ZOOM = 1.03
MARGIN = 0.06
THINNEST = 0.3  # of the widest axis


def is_flat(shape: Skeleton) -> bool:
    """Whether everything lies in one plane of constant z."""
    points = shape.points
    return bool(points.size) and float(np.ptp(points[:, 2])) < FLAT


def scene_axes(figure: Any, shape: Skeleton, view: tuple[float, float] | None, place: Any = 111) -> Any:
    """Axes for a machine; a `view` asks for three dimensions."""
    if view is None and is_flat(shape):
        return figure.add_subplot(place)
    return figure.add_subplot(place, projection="3d")


def dimensions(ax: Any) -> int:
    """2 or 3."""
    return 3 if hasattr(ax, "get_zlim") else 2


def on(ax: Any, points: ArrayLike) -> Any:
    """Coordinates (mm) of points (n, 3) or (3,) m, one array for each dimension of the axes."""
    return (MM * np.asarray(points, dtype=float).T)[: dimensions(ax)]


def flat_marks(ax: Any) -> dict[str, Any]:
    """What a scatter of marks needs in three dimensions only."""
    return {"depthshade": False} if dimensions(ax) == 3 else {"zorder": 4}


def draw_body(ax: Any, points: Floats) -> None:
    """A platform: the plate between the joints (n, 3) m that hold it."""
    ordered = plate(points)
    corners = on(ax, ordered if len(ordered) else points).T
    if dimensions(ax) == 2:
        ax.add_patch(
            Polygon(corners, facecolor="0.55", edgecolor="0.25", alpha=0.5, zorder=1, label="platform")
        )
        return
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    ax.add_collection3d(
        Poly3DCollection([corners], facecolor="0.55", edgecolor="0.25", alpha=0.45, label="platform")
    )


def draw_arrow(ax: Any, tail: Floats, arrow: Floats, **look: Any) -> None:
    """A force, from `tail` along `arrow` (3,) m."""
    start, way = on(ax, tail), on(ax, arrow)
    if dimensions(ax) == 3:
        ax.quiver(*start, *way, lw=2.2, arrow_length_ratio=0.3, **look)
    elif np.linalg.norm(way) > 0.0:
        ax.quiver(*start, *way, angles="xy", scale_units="xy", scale=1, width=0.012, zorder=5, **look)


def finish(ax: Any, shape: Skeleton, view: tuple[float, float] | None = None) -> None:
    """Equal scales, direction of view, labels, and limits that leave no empty room."""
    ax.set(xlabel="x, mm", ylabel="y, mm")
    if dimensions(ax) == 2:
        ax.margins(MARGIN)
        ax.autoscale_view()
        ax.set_aspect("equal", adjustable="datalim")
        ax.grid(color="0.9", lw=0.5)
        ax.set_axisbelow(True)
        return
    ax.set_zlabel("z, mm")
    ax.set_aspect("equal")
    for limits, to in (
        (ax.get_xlim(), ax.set_xlim),
        (ax.get_ylim(), ax.set_ylim),
        (ax.get_zlim(), ax.set_zlim),
    ):
        widest = max(float(np.ptp(other())) for other in (ax.get_xlim, ax.get_ylim, ax.get_zlim))
        if float(np.ptp(limits)) < THINNEST * widest:  # room for the numbers of the axis
            to(np.mean(limits) - THINNEST * widest / 2, np.mean(limits) + THINNEST * widest / 2)
    spans = [float(np.ptp(limits)) for limits in (ax.get_xlim(), ax.get_ylim(), ax.get_zlim())]
    ax.set_box_aspect(spans, zoom=ZOOM)
    ax.view_init(*(view or (22.0, 35.0)))
    ax.locator_params(nbins=5)  # numbers of slanting axes would run into each other


def tool(ax: Any, shape: Skeleton) -> None:
    """From the middle of the platform to the TCP."""
    if len(shape.platform):
        middle = shape.platform.mean(axis=0)
        if np.linalg.norm(shape.tcp - middle) > 1e-6:
            ax.plot(*on(ax, np.stack([middle, shape.tcp])), color=BLACK, lw=1.2, zorder=1)
