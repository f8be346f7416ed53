"""Gauss' rule, made once."""

from __future__ import annotations

from functools import cache

import numpy as np

from stiffmap.common.broadcasting import Floats


@cache
def gauss(count: int) -> tuple[Floats, Floats]:
    """Nodes (count,) on -1 … 1 and weights; not to be written to."""
    node, weight = np.polynomial.legendre.leggauss(count)
    return np.asarray(node, dtype=float), np.asarray(weight, dtype=float)
