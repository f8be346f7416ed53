"""Values of a measure over the nodes of the box, as pictures draw them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.workspace.performance.table import Row


class BoxMap(NamedTuple):
    """Nodes along each axis, m, and values (x, y, z) in the measure's shown unit."""

    x: Floats
    y: Floats
    z: Floats
    values: Floats


def box_map(row: Row) -> BoxMap | None:
    """Of a row of a table of measures; None where its poses are no grid."""
    if row.found.positions is None or row.found.values is None:
        return None
    x, y, z = (np.unique(row.found.positions[:, i]) for i in range(3))
    if len(x) * len(y) * len(z) != len(row.found.values):
        return None
    values = row.found.values.reshape(len(x), len(y), len(z))
    return BoxMap(x, y, z, np.asarray(row.measure.factor * values))


def levels(*values: Floats) -> Floats:
    """Thirteen that increase, from the least to the largest finite value."""
    every = np.concatenate([v.ravel() for v in values])
    finite = every[np.isfinite(every)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    return np.linspace(low, high if high - low > 1e-9 * abs(high) else low + max(abs(low), 1.0), 13)
