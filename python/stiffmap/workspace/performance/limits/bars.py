"""Straight members of a machine's legs, and how near those of different legs come."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.compiled.names import Role
from stiffmap.solve.machine import Machine
from stiffmap.workspace.performance.motion.inertia import movers

SHORT = 0.02  # of the machine's characteristic length: joints nearer than that are one


class Bars:
    """Axes of the members between successive joints of each leg, at home; pairs of different legs."""

    def __init__(self, machine: Machine) -> None:
        self._compiled = machine.compiled
        compiled, home = machine.compiled, machine.compiled.home_coordinates()
        where = compiled.frames(home)[0]
        spans: set[tuple[int, int]] = set()
        for *_, primary, end in compiled.loops:
            for tip in (primary, end):
                chain = self._joints(tip)
                for a, b in pairwise(chain):
                    if np.linalg.norm(where[b] - where[a]) > SHORT * compiled.length and self._leg(a):
                        spans.add((a, b))
        self.spans = sorted(spans)
        self.nodes = tuple(sorted({n for span in self.spans for n in span}))
        place = {n: i for i, n in enumerate(self.nodes)}
        self._ends = np.array([[place[a], place[b]] for a, b in self.spans], dtype=int).reshape(-1, 2)
        legs = [self._leg(b) for _, b in self.spans]
        self.pairs = np.array(
            [(i, j) for i in range(len(legs)) for j in range(i) if legs[i] != legs[j]], dtype=int
        ).reshape(-1, 2)

    def _joints(self, node: int) -> list[int]:
        """Frames of the joints from the base to a frame; what lies beyond the last one is the platform."""
        roles = self._compiled.names.roles
        found = [at for at, c in movers(self._compiled, node) if roles[c] != Role.SPRING]
        return found[::-1]

    def _leg(self, node: int) -> str:
        """Leg that moves a frame; empty where none does."""
        names = self._compiled.names
        first = (names.coordinates[c].split(".")[0] for _, c in movers(self._compiled, node))
        leg = next(first, "")
        return leg if leg in names.legs else ""

    def least_distance(self, coordinates: Floats) -> Floats:
        """(n,) m between the axes of members of different legs at (n, coordinates); NaN stays NaN."""
        out = np.full(len(coordinates), np.nan)
        ok = np.isfinite(coordinates).all(axis=1)
        points = [self._compiled.frames(x)[0][list(self.nodes)] for x in coordinates[ok]]
        if points:
            out[ok] = self.over(np.array(points), np.zeros((len(points), len(self.nodes))))[0]
        return out

    def over(self, points: Floats, moved: Floats) -> tuple[Floats, Floats]:
        """(n,) least distance at the points (n, nodes, 3), and how much less it may be where these move."""
        if not len(self.pairs):
            return np.full(len(points), np.inf), np.zeros(len(points))
        a, b = (points[:, self._ends[self.pairs[:, i]]] for i in (0, 1))
        d = segment_distance(a[:, :, 0], a[:, :, 1], b[:, :, 0], b[:, :, 1])
        far = moved[:, self._ends].max(axis=2)
        less = far[:, self.pairs[:, 0]] + far[:, self.pairs[:, 1]]
        with np.errstate(invalid="ignore"):
            worst = np.argmin(d - less, axis=1)
        rows = np.arange(len(d))
        least = d.min(axis=1)
        return least, np.asarray(least - (d - less)[rows, worst])


def segment_distance(a: Floats, b: Floats, c: Floats, d: Floats) -> Floats:
    """(...) least distance between the segments a b and c d, (..., 3) each."""
    u, v, r = b - a, d - c, a - c
    uu, uv, vv = (np.einsum("...i,...i", x, y) for x, y in ((u, u), (u, v), (v, v)))
    ur, vr = np.einsum("...i,...i", u, r), np.einsum("...i,...i", v, r)
    with np.errstate(divide="ignore", invalid="ignore"):
        free = uu * vv - uv**2
        s = np.where(free > 1e-12 * uu * vv, (uv * vr - vv * ur) / free, 0.0)
    best = np.full(s.shape, np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        # the inner optimum, then each end of either segment
        ends = np.zeros_like(s), np.ones_like(s)
        near = [np.where(vv > 0, (vr + first * uv) / vv, 0.0) for first in (np.clip(s, 0, 1), *ends)]
        for t in (*(np.clip(t, 0, 1) for t in near), *ends):
            again = np.clip(np.where(uu > 0, (t * uv - ur) / uu, 0.0), 0, 1)
            gap = r + again[..., None] * u - t[..., None] * v
            best = np.fmin(best, np.linalg.norm(gap, axis=-1))
    return np.where(np.isfinite(a).all(axis=-1), best, np.nan)
