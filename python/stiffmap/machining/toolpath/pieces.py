"""Lines and arcs through moved points of a path, within a stated distance."""

from __future__ import annotations

from math import isnan, nan
from typing import NamedTuple

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.machining.toolpath.path import Kind

WIDEST = np.pi
"""rad of one arc."""
FLAT = {2: [0, 1], 1: [2, 0], 0: [1, 2]}
"""Axes of the plane of an arc, right-handed about its normal."""
EVEN = 1e-4
"""rad by which the turn of a tool may be off the even one over a piece."""


class MovedPiece(NamedTuple):
    """A line or an arc in the axes of the part, m and rad."""

    kind: Kind
    end: Floats
    centre: Floats
    sweep: float
    turn: float = nan
    """rad, of the tool about its axis at the end; NaN where nothing turns it."""


def line_pieces(points: Floats, within: float, turn: Floats | None = None) -> list[MovedPiece]:
    """Lines through some of the points (k, 3), the others no further than `within` (m) from them; turn (k,) rad is even over each."""
    turn = np.full(len(points), nan) if turn is None else turn
    out: list[MovedPiece] = []
    stack = [(0, len(points) - 1)]
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
            skewed = _uneven(turn, i, j)
            if far[worst] > within or skewed:
                middle = i + 1 + worst if far[worst] > within else skewed
                stack += [(middle, j), (i, middle)]
                continue
        out.append(MovedPiece(Kind.LINE, b, np.full(3, nan), 0.0, float(turn[j])))
    return out


def _uneven(turn: Floats, i: int, j: int) -> int:
    """The point between i and j where the turn is furthest from even; 0 where it is even."""
    if isnan(turn[i]) or j < i + 2:
        return 0
    far = np.abs(turn[i : j + 1] - np.linspace(turn[i], turn[j], j + 1 - i))
    worst = int(np.argmax(far))
    return i + worst if far[worst] > EVEN else 0


def arc_pieces(
    points: Floats, normal: int, sense: float, within: float, turn: Floats | None = None
) -> list[MovedPiece]:
    """Arcs about an axis (0, 1, 2) through points (k, 3), k odd; lines where three points do not make one."""
    turn = np.full(len(points), nan) if turn is None else turn
    out: list[MovedPiece] = []
    stack = [(0, len(points) - 1)]
    while stack:
        i, j = stack.pop()
        middle = (i + j) // 2
        arc = _arc(points[i : j + 1], middle - i, normal, sense, float(turn[j]))
        near = arc is not None and abs(arc.sweep) <= WIDEST and _off(points[i : j + 1], arc, normal) <= within
        if arc is not None and near and not _uneven(turn, i, j):
            out.append(arc)
        elif j - i <= 2:
            if arc is None or abs(arc.sweep) > WIDEST or _uneven(turn, i, j) or j - i < 2:
                out += line_pieces(points[i : j + 1], within, turn[i : j + 1])
            else:  # one circle, but not one rise: an arc to the middle and one from it
                share = _angles(points[i : j + 1], arc, normal)[1] / arc.sweep
                sweeps = share * arc.sweep, (1 - share) * arc.sweep
                out.append(arc._replace(end=points[middle], sweep=sweeps[0], turn=float(turn[middle])))
                out.append(arc._replace(sweep=sweeps[1]))
        else:
            middle += (middle - i) % 2  # both halves keep an even number of intervals
            stack += [(middle, j), (i, middle)]
    return out


def _flat(points: Floats, normal: int) -> Floats:
    """(k, 2) in the plane of the arc, right-handed about its normal."""
    return points[:, FLAT[normal]]


def _arc(points: Floats, middle: int, normal: int, sense: float, turn: float) -> MovedPiece | None:
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
    centre[FLAT[normal]] = x
    return MovedPiece(Kind.ARC, points[-1], centre, sweep, turn)


def _off(points: Floats, arc: MovedPiece, normal: int) -> float:
    """m: largest distance of the points from the arc (or helix)."""
    radius = np.linalg.norm(_flat(points, normal) - _flat(arc.centre[None], normal), axis=1)
    angle = _angles(points, arc, normal)
    if (np.diff(angle) * arc.sweep < -1e-12).any():  # they go round more than once
        return float("inf")
    rise = points[:, normal] - points[0, normal]
    along = (points[-1, normal] - points[0, normal]) * angle / arc.sweep
    return float(np.hypot(radius - radius[0], rise - along).max())


def _angles(points: Floats, arc: MovedPiece, normal: int) -> Floats:
    """(k,) rad of the points along an arc."""
    spoke = _flat(points, normal) - _flat(arc.centre[None], normal)
    angle = np.arctan2(spoke[0, 0] * spoke[:, 1] - spoke[0, 1] * spoke[:, 0], spoke @ spoke[0])
    angle = np.where(angle * arc.sweep < -1e-12, angle + np.sign(arc.sweep) * 2 * np.pi, angle)
    return np.asarray(angle)
