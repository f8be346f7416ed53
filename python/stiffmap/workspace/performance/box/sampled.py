"""Cells judged by 27 nodes each, where no enclosure can be had: sampled, not proven (docs/measures.md)."""

from __future__ import annotations

from itertools import product

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.workspace.performance.box.cell import Cells
from stiffmap.workspace.performance.limits.limits import Bounds

SAFETY = 2.0
"""On second derivatives, which are second differences between the nodes of each cell."""
_NODES = np.array(list(product((-1.0, 0.0, 1.0), repeat=3)))
_MIDDLE = 13
_LINES = [
    [[int(np.ravel_multi_index(tuple(np.insert(rest, axis, v)), (3, 3, 3))) for v in (0, 1, 2)]
     for rest in product((0, 1, 2), repeat=2)]
    for axis in range(3)
]  # fmt: skip


def sample(bounds: Bounds, centre: Floats, half: Floats, axes: Floats) -> Cells:
    """As `Bounds.over`, from nodes: an array differs from its interpolant by its second differences."""
    n = len(centre)
    local = _NODES[None] * half[:, None]
    closed, limits = bounds.at((centre[:, None] + local @ axes.T).reshape(-1, 3))
    closed = closed.reshape(n, 27)
    names = ["closure", *(limit.name for limit in limits)]
    most, mid = (
        [np.where(closed.all(axis=1), -np.inf, np.inf)],
        [np.where(closed[:, _MIDDLE], -np.inf, np.inf)],
    )
    bend = np.zeros((n, 3))
    for limit in limits:
        values = limit.array.reshape(n, 27, -1)
        nodes = limit.value.reshape(n, 27)
        size = max(abs(limit.most), 1e-9)
        error = np.zeros(n)
        for axis, lines in enumerate(_LINES):
            bends = [
                np.linalg.norm(values[:, a] - 2 * values[:, b] + values[:, c], axis=-1) for a, b, c in lines
            ]
            share = np.max(bends, axis=0) / 8  # of the node spacing's second difference h² f''
            bend[:, axis] += share / size
            error += SAFETY * share
        with np.errstate(invalid="ignore"):
            most.append((nodes.max(axis=1) + error - limit.most) / size)
            mid.append((nodes[:, _MIDDLE] - limit.most) / size)
    table, centres = np.stack(most), np.stack(mid)
    with np.errstate(invalid="ignore"):
        broken = np.asarray(~(centres <= 0).all(axis=0))
        inside = np.asarray((table <= 0).all(axis=0))
        return Cells(inside, broken, np.zeros_like(half),
                     np.argmax(np.where(np.isnan(table), np.inf, table), axis=0), tuple(names), bend)  # fmt: skip
