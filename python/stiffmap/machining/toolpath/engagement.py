"""Points along the cuts of a path, and how wide and deep the tool cuts at each: stock, curves, inside corners (theory.md, M5)."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stiffmap.common.broadcasting import Floats, Integers, real_array
from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import place_text
from stiffmap.machining.process.description import Process
from stiffmap.machining.toolpath.path import Kind, Toolpath
from stiffmap.workspace.maps.inputs import magnitude

CORNER = np.radians(15.0)
"""Turn of a polyline from which on it is a corner and not a curve."""
ALONG = 1e-3
"""Share of the travel across the tool below which a move goes along it."""
MOST = 20_000_000
"""Points of a path."""


@dataclass(frozen=True, eq=False)
class Points:
    """m points of the cuts, in the order of the path; SI, axes of the part."""

    move: Integers
    """(m,)."""
    share: Floats
    """(m,) of the move, 0 to 1."""
    position: Floats
    """(m, 3) m."""
    tangent: Floats
    """(m, 3)."""
    tool: Floats
    """(m, 3) from the tip to the holder."""
    bend: Floats
    """(m, 3) 1/m, towards the centre of curvature."""
    way: Floats
    """(m,) m along the path, cuts only."""
    feed: Floats
    """(m,) m/s, NaN where the path says none."""
    spindle: Floats
    """(m,) rad/s."""

    def __len__(self) -> int:
        return len(self.move)

    def only(self, chosen: NDArray[np.bool_] | Integers) -> Points:
        """Some of the points, by a mask (m,) or by their numbers."""
        return Points(*(getattr(self, f.name)[chosen] for f in fields(self)))

    @property
    def normal(self) -> Floats:
        """(m, 3) to the left of the travel, seen against the tool."""
        n = np.cross(self.tool, self.tangent)
        if self.along.any() and not self.along.all():  # as beside it, on the same move where that can be
            good, bad = np.flatnonzero(~self.along), np.flatnonzero(self.along)
            after = good[np.minimum(np.searchsorted(good, bad), len(good) - 1)]
            before = good[np.maximum(np.searchsorted(good, bad) - 1, 0)]
            n[bad] = n[np.where(self.move[after] == self.move[bad], after, before)]
        return np.asarray(n / np.linalg.norm(n, axis=1, keepdims=True))

    @property
    def along(self) -> NDArray[np.bool_]:
        """(m,) points whose travel is along the tool: nothing is cut across there, as in a plunge."""
        return np.asarray(np.linalg.norm(np.cross(self.tool, self.tangent), axis=1) < ALONG)


def sampled(path: Toolpath, step: float = 2e-3) -> Points:
    """Points no further apart than `step` (m); every cut has its two ends. Raises StiffmapError where nothing cuts."""
    if magnitude(step, "step", "m") > 1.0:  # millimetres were meant
        raise StiffmapError(f"step: expected at most 1000 mm, got {1e3 * step:g} mm")
    cuts = path.cutting()
    length = path.length[cuts]
    count = np.maximum(1, np.ceil(length / step - 1e-9))
    # of arcs an even number of intervals, and enough for an arc through three of their ends
    arcs = path.kind[cuts] == Kind.ARC
    turns = np.maximum(1, np.ceil(np.abs(path.sweep[cuts]) / (2 * np.pi) - 1e-9))
    count = np.where(arcs, np.maximum(2 * np.ceil(count / 2), 8 * turns), count) + 1
    if count.sum() > MOST:
        raise StiffmapError(
            f"step: {count.sum():.3g} points; expected at most {MOST:.0e}: take a larger step"
        )
    n = count.astype(int)
    move = np.repeat(cuts, n)
    first = np.repeat(np.cumsum(n) - n, n)
    share = (np.arange(len(move)) - first) / np.repeat(n - 1, n)
    position, tangent, bend = path.at(move, share)
    smooth, keep = _smooth(path, cuts), np.ones(len(move), bool)
    if smooth.any():  # a table of points: each joint once, with the curvature that its turn stands for
        turn = path.at(cuts[1:], np.zeros(len(cuts) - 1))[1] - path.at(cuts[:-1], np.ones(len(cuts) - 1))[1]
        bent = turn / ((length[1:] + length[:-1]) / 2)[:, None]
        last, opens = np.cumsum(n) - 1, np.cumsum(n) - n
        # the end of a curve bends like its last joint, its start like its first
        bend[last[1:][smooth]] = bent[smooth]
        bend[opens[:-1][smooth]] = bent[smooth]
        bend[last[:-1][smooth]] = bent[smooth]
        keep[opens[1:][smooth]] = False
    before = np.repeat(np.cumsum(length) - length, n)
    way = before + share * np.repeat(length, n)
    made = Points(
        move, share, position, tangent, path.tool[move], bend, way, path.feed[move], path.spindle[move]
    )
    return made.only(keep)


def _smooth(path: Toolpath, cuts: Integers) -> NDArray[np.bool_]:
    """(cuts - 1,) joints of two lines that turn by less than a corner does."""
    a, b = cuts[:-1], cuts[1:]
    lines = (path.kind[a] == Kind.LINE) & (path.kind[b] == Kind.LINE)
    touch = np.linalg.norm(path.end[a] - path.start[b], axis=1) < 1e-9
    cosine = (path.at(a, np.ones(len(a)))[1] * path.at(b, np.zeros(len(b)))[1]).sum(axis=1)
    return np.asarray(lines & touch & (cosine > np.cos(CORNER)))


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


def within_tool(value: float, name: str, process: Process) -> float:
    """A length (m) above zero and at most the tool's diameter: above, millimetres were meant. Raises StiffmapError."""
    out, most = magnitude(value, name, "m"), process.tool.diameter
    if out > most:
        raise StiffmapError(
            f"{name}: expected at most the tool's diameter of {1e3 * most:g} mm, got {1e3 * out:g} mm"
        )
    return out


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
    own = process.cut.radial if thickness is None else within_tool(thickness, "thickness", process)
    radial = np.full(m, own)
    if thickness is not None and process.cut.side == "slot":
        raise StiffmapError("thickness: a slot is as wide as its tool; expected a climb or conventional cut")
    axial = np.full(m, process.cut.axial)
    if stock is not None:
        radial, axial = _in_box(points, process, stock, side)
    radial[points.along] = axial[points.along] = 0.0
    if process.cut.side == "slot":  # where one of its walls ends at a corner the other goes on
        return Engagement(radial, np.zeros(m), np.zeros(m), axial, np.ones(m, bool))
    corner, wall = _corners(points, path, process, radial, side)
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
    """From the wall of the part away from it until the stock ends, no further than the tool reaches where there is a gap; from the tip
    up to its top. Raises StiffmapError where nothing is cut."""
    out, (low, high), across = -side * points.normal, stock, process.tool.diameter
    wall = points.position - across / 2 * out
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.stack([(low - wall) / out, (high - wall) / out])
    far = np.where(np.abs(out) < 1e-12, np.inf, t.max(axis=0)).min(axis=1)
    near = np.where(np.abs(out) < 1e-12, -np.inf, t.min(axis=0)).max(axis=1)
    inside = ((wall >= low - 1e-9) & (wall <= high + 1e-9)) | (np.abs(out) > 1e-12)
    far = np.where(near > 0, np.minimum(far, across), far)
    width = np.where(inside[:, :2].all(axis=1), far - np.maximum(near, 0.0), 0.0).clip(0.0)
    height = (high[2] - points.position[:, 2]).clip(0.0, high[2] - low[2]).clip(0.0, process.cut.axial)
    height[width == 0] = 0.0  # of a slot the width does not count
    if not height.any():
        first, last = points.position.min(axis=0), points.position.max(axis=0)
        raise StiffmapError(
            f"stock: the tool cuts nothing of it, which reaches from {place_text(low, '.1f')} to {place_text(high, '.1f')}; the tip goes "
            f"from {place_text(first, '.1f')} to {place_text(last, '.1f')} (axes of the part)"
        )
    return width, height


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
