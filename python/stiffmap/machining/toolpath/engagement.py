"""How wide and deep the tool cuts along a path: stock, curves, inside corners (theory.md, M5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stiffmap.common.broadcasting import Floats, real_array, real_number
from stiffmap.common.errors import StiffmapError
from stiffmap.machining.process.description import Process
from stiffmap.machining.toolpath.path import Toolpath
from stiffmap.machining.toolpath.sampling import Points

LEAST_CORNER = np.radians(1.0)
"""Turn below which two moves make no corner."""
OUTMOST = np.radians(170.0)
"""Of an outside corner; a way back is none."""


def box(corners: ArrayLike) -> Floats:
    """(2, 3) m: stock by its lowest and its highest corner, axes of the part; checked."""
    out = real_array(corners, "stock")
    if out.size != 6 or not (np.diff(out.reshape(2, 3), axis=0) > 0).all():
        raise StiffmapError(f"stock: expected two corners (2, 3) in m, the lower first; got {corners!r}")
    return out.reshape(2, 3)


@dataclass(frozen=True, eq=False)
class Engagement:
    """At m points."""

    radial: Floats
    """(m,) m, width of the stock ahead of the wall; the tool cuts at most its diameter of it."""
    curvature: Floats
    """(m,) 1/m of the centre's path, positive where the part lies outside the curve."""
    corner: Floats
    """(m,) rad: arc that the next wall of an inside corner adds ahead."""
    axial: Floats
    """(m,) m, depth."""
    wall: NDArray[np.bool_]
    """(m,) whether the part has a wall there: none within a tool radius of a sharp outside corner."""


def part_side(process: Process) -> float:
    """-1 where the part lies right of the travel (climb), 1 left; a slot has its walls on both, the left one is taken."""
    return -1.0 if process.cut.side == "climb" else 1.0


def engagement(
    points: Points,
    path: Toolpath,
    process: Process,
    stock: Floats | None = None,
    thickness: float | None = None,
) -> Engagement:
    """Width and depth at each point: the process's own, or a `thickness` to trim (m), or what a box of stock holds."""
    m = len(points)
    side = part_side(process)
    radial = np.full(m, process.cut.radial if thickness is None else real_number(thickness, "thickness"))
    if thickness is not None and not 0 < thickness <= process.tool.diameter:
        raise StiffmapError(
            f"thickness: expected above zero and at most the tool's diameter of {1e3 * process.tool.diameter:g} mm, "
            f"got {1e3 * thickness:g} mm"
        )
    axial = np.full(m, process.cut.axial)
    if stock is not None:
        radial, axial = _in_box(points, process, stock, side)
    radial[points.along] = axial[points.along] = 0.0
    corner, wall = _corners(points, path, process, radial, side)
    if process.cut.side == "slot":
        return Engagement(radial, np.zeros(m), np.zeros(m), axial, wall)
    curvature = _over_contact(points, process, -side * (points.bend * points.normal).sum(axis=1))
    return Engagement(radial, curvature, corner, axial, wall)


def _over_contact(points: Points, process: Process, curvature: Floats) -> Floats:
    """Mean over the contact's length l ahead with the weight 2(1 - x/l) of what lies x ahead: where a line becomes an arc the
    stock at the front end of the contact leaves the line by the double integral of the curvature (theory.md, M5)."""
    way, step = points.way, np.diff(points.way, append=points.way[-1:])
    after = np.r_[curvature[1:], curvature[-1:]]
    bent = np.divide(after - curvature, step, out=np.zeros_like(step), where=step > 0)  # linear in between
    turned = np.r_[0.0, np.cumsum(step * (curvature + after) / 2)[:-1]]
    aside = np.r_[0.0, np.cumsum(step * (turned + step * (curvature / 2 + step * bent / 6)))[:-1]]
    end = np.minimum(way + process.tool.diameter / 2 * np.sin(process.arc), way[-1])
    k = np.clip(np.searchsorted(way, end, side="right") - 1, 0, len(way) - 1)
    x, length = end - way[k], end - way
    there = aside[k] + x * (turned[k] + x * (curvature[k] / 2 + x * bent[k] / 6))
    mean = 2 * (there - aside - length * turned) / np.maximum(length, 1e-12) ** 2
    return np.where(length > 1e-7, np.clip(mean, curvature.min(), curvature.max()), curvature)


def _in_box(points: Points, process: Process, stock: Floats, side: float) -> tuple[Floats, Floats]:
    """From the wall of the part away from it until the stock ends; from the tip up to its top."""
    out, (low, high) = -side * points.normal, stock
    wall = points.position - process.tool.diameter / 2 * out
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.stack([(low - wall) / out, (high - wall) / out])
    far = np.where(np.abs(out) < 1e-12, np.inf, t.max(axis=0)).min(axis=1)
    near = np.where(np.abs(out) < 1e-12, -np.inf, t.min(axis=0)).max(axis=1)
    inside = ((wall >= low - 1e-9) & (wall <= high + 1e-9)) | (np.abs(out) > 1e-12)
    width = np.where(inside[:, :2].all(axis=1), far - np.maximum(near, 0.0), 0.0)
    height = (high[2] - points.position[:, 2]).clip(0.0, high[2] - low[2])
    return width.clip(0.0), height.clip(0.0, process.cut.axial)


def _corners(
    points: Points, path: Toolpath, process: Process, radial: Floats, side: float
) -> tuple[Floats, NDArray[np.bool_]]:
    """Ahead of an inside corner the tool already meets the stock of the next wall (theory.md, M8); next to an outside corner the part
    has ended, and there is no wall."""
    extra, wall = np.zeros(len(points)), np.ones(len(points), bool)
    r = process.tool.diameter / 2
    ends = np.flatnonzero(np.diff(points.move, append=-1) != 0)
    starts = np.r_[0, ends[:-1] + 1]
    here, there = ends[:-1], starts[1:]
    a, b = points.tangent[here], points.tangent[there]
    touch = np.linalg.norm(points.position[here] - points.position[there], axis=1) < 1e-9
    turn = np.arctan2((np.cross(a, b) * points.tool[here]).sum(axis=1), (a * b).sum(axis=1))
    inside = -side * turn  # positive: away from the part
    # what comes down along the tool leaves no wall that could end
    down = np.array([points.along[i : j + 1].any() for i, j in zip(starts, ends, strict=True)], bool)
    touch &= (inside > 0) | ~(down[:-1] | down[1:])
    for k in np.flatnonzero(touch & (np.abs(inside) > LEAST_CORNER)):
        theta, way = inside[k], points.way - points.way[ends[k]]
        if theta < 0:
            near = np.abs(way) < (1 - 1e-6) * r * np.tan(min(-theta, OUTMOST) / 2)
            wall[starts[k] : ends[k + 1] + 1] &= ~near[starts[k] : ends[k + 1] + 1]
            continue
        rows = np.arange(starts[k], ends[k] + 1)
        ahead = -way[rows] * np.sin(min(theta, np.pi / 2))
        share = np.clip(1 - (radial[rows] - ahead) / r, -1.0, 1.0)
        half = np.where(radial[rows] > ahead, np.arccos(share), -np.inf)
        own = np.arccos(np.clip(1 - radial[rows] / r, -1.0, 1.0))
        extra[rows] = np.maximum(extra[rows], np.maximum(theta + half - own, 0.0))
    return extra, wall
