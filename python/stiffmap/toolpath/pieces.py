"""Lines and arcs through moved points of a path, within a stated distance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stiffmap.broadcasting import Floats
from stiffmap.toolpath.path import Kind

WIDEST = np.pi
"""rad of one arc."""


class MovedPiece(NamedTuple):
    """A line or an arc in the axes of the part, m and rad."""

    kind: Kind
    end: Floats
    centre: Floats
    sweep: float


def line_pieces(points: Floats, within: float) -> list[MovedPiece]:
    """Lines through some of the points (k, 3), the others no further than `within` (m) from them."""
    out: list[MovedPiece] = []
    stack = [(0, len(points) - 1)]
    none = np.full(3, np.nan)
    while stack:
        i, j = stack.pop()
        a, b = points[i], points[j]
        if j > i + 1:
            way = b - a
            size = float(way @ way)
            inner = points[i + 1 : j] - a
            share = (inner @ way / size).clip(0, 1) if size > 0 else np.zeros(len(inner))
            far = np.linalg.norm(inner - share[:, None] * way, axis=1)
            worst = int(np.argmax(far))
            if far[worst] > within:
                middle = i + 1 + worst
                stack += [(middle, j), (i, middle)]
                continue
        out.append(MovedPiece(Kind.LINE, b, none, 0.0))
    return out


def arc_pieces(points: Floats, normal: int, sense: float, within: float) -> list[MovedPiece]:
    """Arcs about an axis (0, 1, 2) through points (k, 3), k odd; lines where three points do not make one."""
    out: list[MovedPiece] = []
    stack = [(0, len(points) - 1)]
    while stack:
        i, j = stack.pop()
        middle = (i + j) // 2
        arc = _arc(points[i : j + 1], middle - i, normal, sense)
        if arc is not None and abs(arc.sweep) <= WIDEST and _off(points[i : j + 1], arc, normal) <= within:
            out.append(arc)
        elif j - i <= 2:
            out += line_pieces(points[i : j + 1], within) if arc is None or abs(arc.sweep) > WIDEST else [arc]
        else:
            middle += (middle - i) % 2  # both halves keep an even number of intervals
            stack += [(middle, j), (i, middle)]
    return out


def _flat(points: Floats, normal: int) -> Floats:
    """(k, 2) in the plane of the arc, right-handed about its normal."""
    return points[:, {2: [0, 1], 1: [2, 0], 0: [1, 2]}[normal]]


def _arc(points: Floats, middle: int, normal: int, sense: float) -> MovedPiece | None:
    flat = _flat(points, normal)
    a, b, c = flat[0], flat[middle], flat[-1]
    ab, ac = b - a, c - a
    det = 2 * (ab[0] * ac[1] - ab[1] * ac[0])
    if abs(det) < 1e-18 or det * sense < 0:
        return None
    u, v = ab @ ab, ac @ ac
    x = a + np.array([ac[1] * u - ab[1] * v, ab[0] * v - ac[0] * u]) / det
    p, q = a - x, c - x
    sweep = float(np.arctan2(p[0] * q[1] - p[1] * q[0], p @ q))
    if sweep * sense < 0:
        sweep += sense * 2 * np.pi
    centre = points[0].copy()
    centre[{2: [0, 1], 1: [2, 0], 0: [1, 2]}[normal]] = x
    return MovedPiece(Kind.ARC, points[-1], centre, sweep)


def _off(points: Floats, arc: MovedPiece, normal: int) -> float:
    """m: largest distance of the points from the arc (or helix)."""
    flat, centre = _flat(points, normal), _flat(arc.centre[None], normal)[0]
    spoke = flat - centre
    radius = np.linalg.norm(spoke, axis=1)
    angle = np.arctan2(spoke[0, 0] * spoke[:, 1] - spoke[0, 1] * spoke[:, 0], spoke @ spoke[0])
    angle = np.where(angle * arc.sweep < -1e-12, angle + np.sign(arc.sweep) * 2 * np.pi, angle)
    rise = points[:, normal] - points[0, normal]
    along = (points[-1, normal] - points[0, normal]) * angle / arc.sweep
    return float(np.hypot(radius - radius[0], rise - along).max())
