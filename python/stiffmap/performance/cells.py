"""Proof that a box of positions keeps all limits, nodes and what lies between them (theory D8)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from stiffmap.broadcasting import Floats
from stiffmap.performance.limits import Bounds

SAFETY = 2.0
"""On second derivatives, which are second differences between 27 nodes of each cell."""
FIRST = 3
"""Cells along each edge at first."""
DEEPEST = 9
_NODES = np.array(list(product((0, 1, 2), repeat=3)))
_LINES = [
    [[int(np.ravel_multi_index(tuple(np.insert(rest, axis, v)), (3, 3, 3))) for v in (0, 1, 2)]
     for rest in product((0, 1, 2), repeat=2)]
    for axis in range(3)
]  # fmt: skip


@dataclass(frozen=True, eq=False)
class Proof:
    """Whether a box keeps its limits; where not, poses that break one."""

    holds: bool
    broken: Floats
    """(k, 3) positions that break a limit, empty where the box holds or nothing was decided."""
    limit: str
    """The limit that is broken, or that left the last cells undecided."""
    worst: float
    """Largest value of that limit over its bound, at a node."""


def prove(bounds: Bounds, low: Floats, high: Floats) -> Proof:
    """Cells are halved until each is proven by its nodes and second differences, or a node fails."""
    unit = (high - low) / FIRST
    cells = np.array(list(product(range(FIRST), repeat=3)), dtype=float)
    scale, worst, name = 1.0, 0.0, ""
    for _ in range(DEEPEST):
        lattice, where = np.unique(
            np.rint((cells[:, None] * 2 + _NODES[None]).reshape(-1, 3)).astype(np.int64),
            axis=0,
            return_inverse=True,
        )
        position = low + lattice * (0.5 * scale) * unit
        broken, undecided, name, worst = _judge(bounds, position, where.reshape(len(cells), 27))
        if broken.any():
            return Proof(False, position[broken], name, worst)
        if not undecided.any():
            return Proof(True, np.zeros((0, 3)), name, worst)
        halves = np.array(list(product((0, 1), repeat=3)), dtype=float)
        cells = (2 * cells[undecided][:, None] + halves).reshape(-1, 3)
        scale *= 0.5
    return Proof(False, np.zeros((0, 3)), name, worst)


def _judge(
    bounds: Bounds, position: Floats, where: NDArray[np.int64]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], str, float]:
    """Nodes that break a limit, cells that stay undecided, the tightest limit and its share."""
    closed, limits = bounds.at(position)
    broken = ~closed
    undecided = np.zeros(len(where), dtype=bool)
    tightest, share = ("closure", np.inf) if broken.any() else ("", -np.inf)
    for limit in limits:
        over = closed & ~(limit.value <= limit.most)
        broken |= over
        size = max(abs(limit.most), 1e-9)
        most = float(np.max((limit.value[closed] - limit.most) / size, initial=-np.inf))
        if most > share and tightest != "closure":
            tightest, share = limit.name, most
        values = limit.array[where]
        error = np.zeros(len(where))
        for lines in _LINES:
            bends = [
                np.linalg.norm(values[:, a] - 2 * values[:, b] + values[:, c], axis=-1) for a, b, c in lines
            ]
            # a node spacing h has the second difference h² f''; the interpolation error is h² f'' / 8
            error += SAFETY * np.max(bends, axis=0) / 8
        top = limit.value[where].max(axis=1)
        with np.errstate(invalid="ignore"):
            undecided |= ~(top + error <= limit.most)
    return broken, undecided, tightest, 1 + share
