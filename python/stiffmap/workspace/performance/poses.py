"""Boxes of poses."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats, real_array, whole_number
from stiffmap.common.errors import StiffmapError
from stiffmap.solve.machine import Machine


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
