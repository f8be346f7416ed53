"""What is known of whole cells of positions."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats

BOX = np.array(list(product((-1.0, 1.0), repeat=3)))
"""(8, 3) corners of a cell, in half lengths."""


@dataclass(frozen=True, eq=False)
class Cells:
    """What was proven of cells of positions (n)."""

    inside: NDArray[np.bool_]
    """Every pose of the cell closes and keeps all limits."""
    broken: NDArray[np.bool_]
    """Some pose of it does not."""
    where: Floats
    """(n, 3) that pose, from the centre, along the cell's axes."""
    limit: NDArray[np.int64]
    """Index into `names` of the limit nearest to its bound, or beyond."""
    names: tuple[str, ...]
    bend: Floats
    """(n, 3) share of each axis in the curvature; NaN: unknown."""
