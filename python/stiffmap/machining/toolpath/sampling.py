"""Points along the cuts of a path."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.machining.toolpath.path import Integers, Kind, Toolpath
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
    magnitude(step, "step", "m")
    cuts = np.flatnonzero(path.cuts)
    if not cuts.size:
        raise StiffmapError(f"{path.name}: no move cuts (moves at a feed across the tool)")
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
