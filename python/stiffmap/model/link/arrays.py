"""Array aliases, the cross-product matrix and the scales of a matrix that the link modules share."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]


def skew(vectors: Floats) -> Floats:
    """Cross-product matrices S(v), (..., 3) -> (..., 3, 3), so that ``S(v) @ w == cross(v, w)``."""
    v = np.asarray(vectors, dtype=float)
    out = np.zeros((*v.shape[:-1], 3, 3))
    out[..., 0, 1], out[..., 0, 2] = -v[..., 2], v[..., 1]
    out[..., 1, 0], out[..., 1, 2] = v[..., 2], -v[..., 0]
    out[..., 2, 0], out[..., 2, 1] = -v[..., 1], v[..., 0]
    return out


def standard_errors(covariance: Floats) -> Floats:
    """(6, 6) standard errors of the entries whose covariance (36, 36), row-major, is given."""
    return np.asarray(np.sqrt(np.maximum(np.diag(covariance), 0.0)).reshape(6, 6))


def unit_diagonal(matrix: Floats) -> Floats:
    """(6, 6) matrix over the square roots of its diagonal terms; those that are zero count as one."""
    size = np.sqrt(np.abs(np.diag(matrix)))
    size = np.where(size > 0, size, 1.0)
    return np.asarray(matrix / np.outer(size, size))
