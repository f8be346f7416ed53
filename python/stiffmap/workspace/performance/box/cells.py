"""Whether a cube of positions keeps all limits, inside as well as on its border; how much of it does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.workspace.performance.box.proof import Judge

FIRST = 4  # cells along each edge at first
HALVED = 0.5  # axes with this share of the largest curvature, or more, are halved too


@dataclass(frozen=True, eq=False)
class Shrunk:
    """The largest cube about a centre, up to the one asked for, that was decided to keep all limits."""

    edge: float
    broken: Floats  # (k, 3) positions that break a limit, in the cube's own coordinates
    names: tuple[str, ...]  # limits that stopped it, or that came nearest to
    cells: int


def shrink(
    judge: Judge,
    axes: Floats,
    shape: Floats,
    centre: Floats,
    edge: float,
    least: float,
    gap: float,
    work: int,
) -> Shrunk:
    """Cells are halved until decided; an undecided one of a size near `gap`, or a point that breaks a
    limit, shrinks the cube about its centre instead. Coordinates along `axes`, divided by `shape`.

    Gives up (edge 0) below `least`, or when more than `work` cells were asked for.
    """
    step = np.arange(FIRST) / FIRST
    low = np.stack(np.meshgrid(step, step, step, indexing="ij"), axis=-1).reshape(-1, 3)
    low = centre - edge / 2 + edge * low
    high = low + edge / FIRST
    broken: list[Floats] = []
    names: dict[str, int] = {}
    last, count, back = "", 0, 0.1 * gap
    while len(low):
        if count + len(low) > work or edge <= least:
            return Shrunk(0.0, _points(broken), tuple(names) or (last,), count)
        middle, half = (low + high) / 2, (high - low) / 2
        found = judge((middle * shape) @ axes.T, half * shape, axes)
        count += len(low)
        outside = found.broken
        if outside.any():
            points = (middle + found.where / shape)[outside]
            broken.append(points)
            for i in np.unique(found.limit[outside]):
                names[found.names[i]] = 1
            edge = min(edge, 2 * float(np.abs(points - centre).max(axis=1).min()) - back)
            back *= 3  # a face that sticks out is left in few steps
        left = ~found.inside
        last = found.names[int(found.limit[left][0])] if left.any() else last
        low, high, bend = low[left], high[left], found.bend[left]
        size = (high - low).max(axis=1) if len(low) else np.zeros(0)
        tiny = size < 0.05 * gap
        if tiny.any():
            near = np.maximum(np.maximum(low - centre, centre - high).max(axis=1), 0.0)[tiny]
            edge = min(edge, 2 * float(near.min()))
            names[last] = 1
        low, high = np.maximum(low, centre - edge / 2), np.minimum(high, centre + edge / 2)
        kept = (high - low > 1e-15).all(axis=1)
        low, high = halved(low[kept], high[kept], bend[kept])
    return Shrunk(edge, _points(broken), tuple(names) or ((last,) if last else ()), count)


def halved(low: Floats, high: Floats, bend: Floats) -> tuple[Floats, Floats]:
    """Each cell cut in two along the axes that curve most; along the longest where that is not known."""
    size = high - low
    known = np.isfinite(bend).all(axis=1, keepdims=True)
    weight = np.where(known, bend * size / np.maximum(size.max(axis=1, keepdims=True), 1e-300), size)
    # an axis along which nothing curves is cut as well when it is far longer than the others
    weight = weight + 1e-3 * size / np.maximum(size.max(axis=1, keepdims=True), 1e-300) * weight.max(
        axis=1, keepdims=True
    )
    weight = np.where(weight.max(axis=1, keepdims=True) > 0, weight, size)
    cut: NDArray[np.bool_] = np.greater_equal(weight, HALVED * weight.max(axis=1, keepdims=True))
    for axis in range(3):
        chosen, n = np.flatnonzero(cut[:, axis]), len(low)
        middle = (low[chosen, axis] + high[chosen, axis]) / 2
        low, high = (np.concatenate([a, a[chosen]]) for a in (low, high))
        cut = np.concatenate([cut, cut[chosen]])
        high[chosen, axis] = low[n:, axis] = middle
    return low, high


def _points(parts: list[Floats]) -> Floats:
    return np.concatenate(parts) if parts else np.zeros((0, 3))
