"""Loaded poses, and boxes of poses."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import (
    Floats,
    batch,
    real_array,
    rows,
    whole_number,
    wrench_array,
)
from stiffmap.common.errors import StiffmapError
from stiffmap.solve.closing import commanded
from stiffmap.solve.machine import Machine


def loaded_poses(
    machine: Machine, position: ArrayLike, wrench: ArrayLike | None, rotation: ArrayLike | None
) -> tuple[tuple[int, ...], Floats, Floats, Floats]:
    """Batch axes of commanded poses under a wrench each, and positions (n, 3) m, rotations (n, 3, 3), wrenches (n, 6) N, N·m of all of
    them; None: as at home, no wrench. StiffmapError for bad input."""
    p, r = commanded(machine.compiled, position, rotation)
    w = wrench_array(wrench)
    shape = batch(p.shape[:-1], w.shape[:-1], r.shape[:-2])
    return shape, rows(p, shape, (3,)), rows(r, shape, (3, 3)), rows(w, shape, (6,))


def read_box(machine: Machine, box: ArrayLike | None) -> tuple[Floats, Floats]:
    """Lowest and highest corner, (3,) m each; the machine's workspace where none is given."""
    given = machine.workspace if box is None else real_array(box, "box")
    if given.shape != (2, 3) or not np.isfinite(given).all() or (given[1] < given[0]).any():
        raise StiffmapError(
            f"box: expected lowest and highest corner (2, 3) in m, base axes, got {np.asarray(box).tolist()}"
        )
    return given[0], given[1]


def read_region(region: ArrayLike, axes: Sequence[int] = (0, 1, 2)) -> Floats:
    """(2, 3) m, where to look: lowest and highest corner, apart along these axes."""
    out = real_array(region, "region")
    if out.shape != (2, 3) or not (np.isfinite(out).all() and (out[1] > out[0])[list(axes)].all()):
        raise StiffmapError(f"region: expected lowest and highest corner (2, 3) in m, got {region!r}")
    return out


def box_nodes(low: Floats, high: Floats, nodes: int) -> Floats:
    """(nodes³, 3), the last axis fastest; an edge without length has one node."""
    whole_number(nodes, "nodes", 2)
    axes = [np.linspace(a, b, nodes if b > a else 1) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
