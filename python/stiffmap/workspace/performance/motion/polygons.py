"""Polygons {v: |R v + b| <= limit} in a plane: the hexagon of Figure 1c, for any number of drives."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.common.short import short_repr

NOTHING = 1e-12
"""Entries of the rows, relative to their largest, that count as zero: directions a drive does not feel."""


@short_repr
@dataclass(frozen=True, eq=False)
class Polygon:
    """What the drives can do in a plane, at poses (...)."""

    vertices: Floats
    """(..., m, 2) counter-clockwise, m the largest number of vertices; the last one repeats to fill up."""
    inner: Floats
    """(...) radius reached in every direction of the plane; 0 where the drives cannot hold the pose."""
    outer: Floats
    """(...) radius reached in the best direction."""
    outer_direction: Floats
    """(...) its angle in the plane, rad."""
    inner_direction: Floats
    """(...) angle of the weakest direction, rad."""
    status: NDArray[np.uint8]


def section_polygon(
    rows: Floats, limits: Floats, status: NDArray[np.uint8], bias: Floats | float = 0.0
) -> Polygon:
    """Polygon of |rows v + bias| <= limits; rows (..., drives, 2), limits (drives,), bias (..., drives)."""
    n = rows.shape[-2]
    half, room, inner, toward = _nearest_border(rows, limits, bias)
    points = _crossings(half, room, 2 * n)
    vertices, outer, best = _ordered(points)
    bad = np.asarray(~np.isfinite(rows).all(axis=(-2, -1)))
    return Polygon(
        vertices=np.where(bad[..., None, None], np.nan, vertices),
        inner=np.where(bad, np.nan, inner),
        outer=np.where(bad, np.nan, outer),
        outer_direction=np.where(bad, np.nan, best),
        inner_direction=np.where(bad, np.nan, np.arctan2(toward[..., 1], toward[..., 0])),
        status=status,
    )


def inner_radius(rows: Floats, limits: Floats, bias: Floats | float = 0.0) -> Floats:
    """(...) the polygon's inner radius alone, which is far quicker than its vertices."""
    inner = _nearest_border(rows, limits, bias)[2]
    return np.where(np.isfinite(rows).all(axis=(-2, -1)), inner, np.nan)


def _nearest_border(
    rows: Floats, limits: Floats, bias: Floats | float
) -> tuple[Floats, Floats, Floats, Floats]:
    """Half-spaces half . v <= room, the distance of the nearest border and its normal."""
    bias = np.broadcast_to(bias, rows.shape[:-1])
    half = np.concatenate([rows, -rows], axis=-2)
    room = np.concatenate([limits - bias, limits + bias], axis=-1)
    half = np.where(np.abs(half) < NOTHING * np.nanmax(np.abs(rows), initial=1e-300), 0.0, half)
    norms = np.linalg.norm(half, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        distance = np.where(norms > 1e-300, room / norms, np.where(room >= 0, np.inf, -np.inf))
    weakest = np.argmin(np.where(np.isnan(distance), np.inf, distance), axis=-1)[..., None]
    inner = np.maximum(np.take_along_axis(distance, weakest, -1)[..., 0], 0.0)
    return half, room, inner, np.take_along_axis(half, weakest[..., None], -2)[..., 0, :]


def _crossings(half: Floats, room: Floats, count: int) -> Floats:
    """(..., pairs, 2) crossings of two borders that satisfy all others; NaN for the rest."""
    out = []
    slack = 1e-9 * np.abs(room).max(axis=-1, initial=0.0)
    for a, b in combinations(range(count), 2):
        (p, q), (r, s) = (half[..., a, 0], half[..., a, 1]), (half[..., b, 0], half[..., b, 1])
        det = p * s - q * r
        with np.errstate(invalid="ignore", divide="ignore"):
            v = np.stack(
                [(room[..., a] * s - q * room[..., b]) / det, (p * room[..., b] - r * room[..., a]) / det],
                axis=-1,
            )
            held = (half @ v[..., None])[..., 0]
            ok = np.isfinite(v).all(axis=-1) & (held <= room + slack[..., None]).all(axis=-1)
        out.append(np.where(ok[..., None], v, np.nan))
    return np.stack(out, axis=-2)


def _ordered(points: Floats) -> tuple[Floats, Floats, Floats]:
    """Vertices by angle about their mean, the largest norm and its direction."""
    some = np.asarray(np.isfinite(points).all(axis=-1))
    count = np.maximum(some.sum(axis=-1), 1)[..., None]
    centre = np.where(some[..., None], points, 0.0).sum(axis=-2) / count
    offset = points - centre[..., None, :]
    angle = np.where(some, np.arctan2(offset[..., 1], offset[..., 0]), np.inf)
    order = np.argsort(angle, axis=-1)
    ordered = np.take_along_axis(points, order[..., None], -2)
    most = max(int(some.sum(axis=-1).max(initial=0)), 1)
    last = np.take_along_axis(ordered, (count - 1)[..., None], -2)
    ordered = np.where(np.isfinite(ordered), ordered, last)[..., :most, :]
    size = np.where(some, np.linalg.norm(points, axis=-1), -np.inf)
    best = np.argmax(size, axis=-1)[..., None]
    far = np.take_along_axis(points, best[..., None], -2)[..., 0, :]
    outer = np.take_along_axis(size, best, -1)[..., 0]
    return ordered, np.where(np.isfinite(outer), outer, 0.0), np.arctan2(far[..., 1], far[..., 0])
