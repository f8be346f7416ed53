"""Small products summed in a fixed order, so that a number does not depend on the batch it is in."""

from __future__ import annotations

import numpy as np

from stiffmap.common.broadcasting import Floats


def dot(a: Floats, b: Floats) -> Floats:
    """Scalar product over the last axis, leading axes broadcast."""
    out = a[..., 0] * b[..., 0]
    for k in range(1, max(a.shape[-1], b.shape[-1])):
        out = out + a[..., k] * b[..., k]
    return np.asarray(out)


def apply(matrix: Floats, vector: Floats) -> Floats:
    """Matrix (..., m, n) times vector (..., n)."""
    return dot(matrix, vector[..., None, :])


def norm(vector: Floats) -> Floats:
    """Euclidean norm over the last axis."""
    return np.asarray(np.sqrt(dot(vector, vector)))
