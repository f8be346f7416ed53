"""A toolpath: straight moves and arcs with their feeds, as arrays; positions and tangents anywhere on it. SI."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import IntEnum
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stiffmap.common.broadcasting import Floats, Integers, real_array, real_number
from stiffmap.common.errors import StiffmapError


class Kind(IntEnum):
    """How a move goes."""

    RAPID = 0
    LINE = 1
    ARC = 2


@dataclass(frozen=True, eq=False)
class Toolpath:
    """n moves of the tool's tip, in the axes of the part."""

    kind: NDArray[np.uint8]
    """(n,) of `Kind`."""
    start: Floats
    """(n, 3) m."""
    end: Floats
    """(n, 3) m."""
    centre: Floats
    """(n, 3) m, of arcs; NaN else."""
    normal: NDArray[np.int8]
    """(n,) axis about which an arc turns: 0, 1, 2 for x, y, z."""
    sweep: Floats
    """(n,) rad about that axis, positive counter-clockwise; 0 for lines."""
    feed: Floats
    """(n,) m/s; NaN where the path says none."""
    spindle: Floats
    """(n,) rad/s; 0: off, NaN: the path says nothing."""
    line: Integers
    """(n,) line of the file, from 1."""
    tool: Floats
    """(n, 3) unit vectors from the tool's tip to its holder, at the end of the move."""
    name: str = "path"
    notes: tuple[str, ...] = ()
    text: tuple[str, ...] = field(default=(), repr=False)
    """Lines of the G-code, where it came from such."""
    turn: Floats | None = None
    """(n,) rad, turn of an arm's tool about its axis at the end of the move; None: the path says nothing."""
    offsets: dict[str, tuple[float, ...]] = field(default_factory=dict)
    """Work offsets with which the G-code was read, m."""
    actions: tuple[tuple[str, int], ...] = ()
    """Dwells, words of spindle, coolant and tool, and stops of the G-code, each with the number of moves before it."""
    given: tuple[int, int, int] = (0, 0, 0)
    """Line of the file from which on each axis is given; before it, where the tool stands is taken as 0."""

    def __len__(self) -> int:
        return len(self.kind)

    @cached_property
    def length(self) -> Floats:
        """(n,) m of each move."""
        straight = np.linalg.norm(self.end - self.start, axis=1)
        arcs = self.kind == Kind.ARC
        if not arcs.any():
            return np.asarray(straight)
        flat = 1.0 - np.eye(3)[self.normal]
        ends = [np.linalg.norm((p - self.centre) * flat, axis=1) for p in (self.start, self.end)]
        radius = (ends[0] + ends[1]) / 2
        rise = np.take_along_axis(self.end - self.start, self.normal[:, None].astype(int), 1)[:, 0]
        return np.asarray(np.where(arcs, np.hypot(radius * self.sweep, rise), straight))

    @cached_property
    def cuts(self) -> NDArray[np.bool_]:
        """(n,) moves at a feed across the tool: plunges along it and rapids are none."""
        way = self.end - self.start
        along = np.abs((way * self.tool).sum(axis=1))
        across = np.sqrt(np.maximum((way**2).sum(axis=1) - along**2, 0.0))
        moving = (self.kind == Kind.ARC) | (across > 1e-9 + 1e-3 * along)
        return np.asarray((self.kind != Kind.RAPID) & moving & (self.length > 0))

    def cutting(self) -> Integers:
        """Numbers of the moves that cut. Raises StiffmapError where none does."""
        found = np.flatnonzero(self.cuts)
        if not found.size:
            raise StiffmapError(f"{self.name}: no move cuts (moves at a feed across the tool)")
        return found

    def turn_at(self, move: Integers, share: Floats) -> Floats | None:
        """(m,) rad at shares (m,) of the moves (m,): even over each move, as axes are driven."""
        if self.turn is None:
            return None
        before = np.r_[self.turn[:1], self.turn[:-1]][move]
        return np.asarray(before + share * (self.turn[move] - before))

    def at(self, move: ArrayLike, s: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Positions (m, 3), unit tangents (m, 3) and curvature vectors (m, 3) 1/m at shares s (m,) of the moves (m,)."""
        i, u = np.asarray(move, dtype=int), np.asarray(s, dtype=float)
        a, b = self.start[i], self.end[i]
        p = a + u[:, None] * (b - a)
        size = np.linalg.norm(b - a, axis=1, keepdims=True)
        t = np.divide(b - a, size, out=np.zeros_like(a), where=size > 0)
        k = np.zeros_like(p)
        arc = np.flatnonzero(self.kind[i] == Kind.ARC)
        if arc.size:
            p[arc], t[arc], k[arc] = self._on_arcs(i[arc], u[arc])
        return p, t, k

    def _on_arcs(self, i: Integers, u: Floats) -> tuple[Floats, Floats, Floats]:
        axis = np.eye(3)[self.normal[i]]
        flat = 1.0 - axis
        spoke = (self.start[i] - self.centre[i]) * flat
        other = (self.end[i] - self.centre[i]) * flat
        r0, r1 = np.linalg.norm(spoke, axis=1), np.linalg.norm(other, axis=1)
        angle = self.sweep[i] * u
        e = spoke / r0[:, None]
        side = np.cross(axis, e)
        out = np.cos(angle)[:, None] * e + np.sin(angle)[:, None] * side
        way = np.cos(angle)[:, None] * side - np.sin(angle)[:, None] * e
        radius = r0 + (r1 - r0) * u
        rise = ((self.end[i] - self.start[i]) * axis).sum(axis=1)
        base = self.centre[i] * flat + ((self.start[i] * axis).sum(1) + u * rise)[:, None] * axis
        speed = (radius * self.sweep[i])[:, None] * way + rise[:, None] * axis + (r1 - r0)[:, None] * out
        tangent = speed / np.linalg.norm(speed, axis=1, keepdims=True)
        share = ((radius * self.sweep[i]) ** 2 / (speed**2).sum(axis=1))[:, None]
        return base + radius[:, None] * out, tangent, -share * out / radius[:, None]

    def placed(self, at: ArrayLike = (0.0, 0.0, 0.0), turn: float = 0.0) -> Placement:
        """Where the part's origin lies (m, base axes) and how it is turned about z (rad)."""
        where, turn = real_array(at, "at"), real_number(turn, "turn", "an angle (rad)")
        if where.shape != (3,) or not np.isfinite(where).all():
            raise StiffmapError(f"at: expected three finite numbers (m), got {at!r}")
        if not abs(turn) <= 2 * np.pi:  # else degrees were meant
            raise StiffmapError(f"turn: expected at most a full turn (2 pi rad), got {turn:.6g} rad")
        return Placement(where, turn)

    def only(self, chosen: ArrayLike) -> Toolpath:
        """Some of the moves, by a mask (n,) or by their numbers in any order; the arrays are copies."""
        chosen = np.asarray(chosen)
        arrays = ("kind", "start", "end", "centre", "normal", "sweep", "feed", "spindle", "line", "tool")
        turn = None if self.turn is None else self.turn[chosen]
        return replace(self, **{n: getattr(self, n)[chosen] for n in arrays}, turn=turn)


@dataclass(frozen=True, eq=False)
class Placement:
    """Where a part lies on the machine."""

    at: Floats
    turn: float = 0.0

    @cached_property
    def rotation(self) -> Floats:
        """(3, 3) from the part's axes to the base's."""
        c, s = np.cos(self.turn), np.sin(self.turn)
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    def points(self, p: Floats) -> Floats:
        """(..., 3) base axes of positions (m) in the part's."""
        return np.asarray(p @ self.rotation.T + self.at)

    def vectors(self, v: Floats) -> Floats:
        """(..., 3) base axes of directions in the part's."""
        return np.asarray(v @ self.rotation.T)

    def back(self, p: Floats) -> Floats:
        """(..., 3) part's axes of positions (m) in the base's."""
        return np.asarray((p - self.at) @ self.rotation)


def path_of(
    points: ArrayLike,
    *,
    feed: ArrayLike = np.nan,
    spindle: ArrayLike = np.nan,
    tool: ArrayLike = (0.0, 0.0, 1.0),
    lines: ArrayLike | None = None,
    name: str = "path",
    turn: Floats | None = None,
) -> Toolpath:
    """Straight moves through points (k, 3) m; feed (k,) m/s, spindle (k,) rad/s, tool axis (k, 3) and turn (k,) rad are those on arriving."""
    p = np.asarray(points, dtype=float)
    if p.ndim != 2 or p.shape[1] != 3 or len(p) < 2 or not np.isfinite(p).all():
        raise StiffmapError(f"path: expected two or more finite points (k, 3) in m, got shape {p.shape}")
    n = len(p) - 1
    axis = np.broadcast_to(np.asarray(tool, dtype=float), p.shape)
    size = np.linalg.norm(axis, axis=1, keepdims=True)
    if not (np.isfinite(size).all() and (size > 0).all()):
        raise StiffmapError("tool axis: expected directions that are not zero")
    along = np.arange(1, n + 1) if lines is None else np.asarray(lines, dtype=np.int64)[1:]
    return Toolpath(
        np.full(n, Kind.LINE, np.uint8), p[:-1].copy(), p[1:].copy(), np.full((n, 3), np.nan), np.full(n, 2, np.int8),
        np.zeros(n), np.broadcast_to(np.asarray(feed, float), len(p))[1:].copy(),
        np.broadcast_to(np.asarray(spindle, float), len(p))[1:].copy(), along.astype(np.int64), (axis / size)[1:].copy(),
        name, turn=None if turn is None else np.asarray(turn, float)[1:].copy(),
    )  # fmt: skip
