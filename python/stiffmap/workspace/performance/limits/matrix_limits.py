"""Bounds of a Jacobian at poses: singular values, corners of the cube of drive rates, rows of the inverse."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.workspace.performance.limits.limit import Limit
from stiffmap.workspace.performance.motion.zonotopes import corners


def spectral(name: str, matrix: Floats, most: float, closed: NDArray[np.bool_]) -> Limit:
    """Largest singular value, and its dyad: a linear lower estimate at neighbours."""
    n = len(matrix)
    value = np.full(n, np.inf)
    left = np.full((n, matrix.shape[1] * matrix.shape[2]), np.nan)
    ok = closed & np.isfinite(matrix).all(axis=(1, 2))
    if ok.any():
        a = matrix[ok]
        wide = a.shape[2] > a.shape[1]
        a = np.swapaxes(a, 1, 2) if wide else a
        v = np.linalg.eigh(np.swapaxes(a, 1, 2) @ a)[1][
            :, :, -1
        ]  # quicker than svd, exact enough for the largest
        image = (a @ v[:, :, None])[:, :, 0]
        value[ok] = size = np.linalg.norm(image, axis=1)
        u = image / np.maximum(size, 1e-300)[:, None]
        u, v = (v, u) if wide else (u, v)
        left[ok] = (u[:, :, None] * v[:, None, :]).reshape(len(a), -1)
    return Limit(name, value, most, matrix.reshape(n, left.shape[1]), left)


def vertices(name: str, matrix: Floats, most: float, closed: NDArray[np.bool_]) -> Limit:
    """Farthest corner of the image of the cube: the norm of J s for the worst s."""
    n, rows, d = matrix.shape
    value, left = np.full(n, np.inf), np.full((n, rows * d), np.nan)
    ok = closed & np.isfinite(matrix).all(axis=(1, 2))
    if ok.any():
        signs = corners(d)
        images = matrix[ok] @ signs.T
        norms = np.linalg.norm(images, axis=1)
        worst = np.argmax(norms, axis=1)
        rows_of = np.arange(len(worst))
        value[ok] = norms[rows_of, worst]
        unit = images[rows_of, :, worst] / value[ok][:, None]
        left[ok] = (unit[:, :, None] * signs[worst][:, None, :]).reshape(len(worst), -1)
    # the change of the value is at most sqrt(d) times that of the matrix
    return Limit(name, value, most, np.sqrt(d) * matrix.reshape(n, rows * d), left / np.sqrt(d))


def rows(name: str, matrix: Floats, most: float, closed: NDArray[np.bool_]) -> Limit:
    """Longest row of the inverse: the drive that first stops a motion."""
    n, d, columns = matrix.shape
    value, left = np.full(n, np.inf), np.full((n, d * columns), np.nan)
    ok = closed & np.isfinite(matrix).all(axis=(1, 2))
    if ok.any():
        norms = np.linalg.norm(matrix[ok], axis=2)
        worst = np.argmax(norms, axis=1)
        rows_of = np.arange(len(worst))
        value[ok] = norms[rows_of, worst]
        pick = np.zeros((len(worst), d, columns))
        pick[rows_of, worst] = matrix[ok][rows_of, worst] / value[ok][:, None]
        left[ok] = pick.reshape(len(worst), -1)
    return Limit(name, value, most, matrix.reshape(n, left.shape[1]), left)
