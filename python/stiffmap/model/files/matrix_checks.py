"""Symmetry and definiteness of a 6x6 whose rows have mixed units: judged after scaling to unit diagonal."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SYMMETRY_TOLERANCE = 1e-12
EIGENVALUE_TOLERANCE = 1e-12


def _scale(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    scale = np.sqrt(np.abs(np.diag(matrix)))
    known = scale > 0.0
    for i in np.flatnonzero(~known):
        # a zero diagonal term has no scale of its own; its couplings, which must vanish, give one
        scale[i] = max(np.abs(matrix[i, known]) / scale[known], default=0.0)
    return np.where(scale > 0.0, scale, 1.0)


def asymmetry(matrix: NDArray[np.float64]) -> tuple[float, int, int]:
    """Largest |k_ij - k_ji| / sqrt(k_ii k_jj) with its row and column; 0 within rounding."""
    scale = _scale(matrix)
    difference = np.abs(matrix - matrix.T) / np.outer(scale, scale)
    i, j = np.unravel_index(int(np.argmax(difference)), difference.shape)
    size = float(difference[i, j])
    return (size if size > SYMMETRY_TOLERANCE else 0.0), int(i), int(j)


def lowest_eigenvalue(matrix: NDArray[np.float64]) -> float:
    """Lowest eigenvalue of the scaled matrix, where negative beyond rounding; else 0."""
    scale = _scale(matrix)
    lowest = float(np.linalg.eigvalsh(matrix / np.outer(scale, scale))[0])
    return lowest if lowest < -EIGENVALUE_TOLERANCE else 0.0
