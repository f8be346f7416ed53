"""A rigid transform between two frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stiffmap.common.number_text import SMALLEST

Vector = tuple[float, float, float]
Rows = tuple[Vector, Vector, Vector]
IDENTITY: Rows = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def vector(values: ArrayLike) -> Vector:
    """Three floats as a hashable tuple; products of dust, which no file holds, are 0."""
    x, y, z = (float(v) if abs(v) >= SMALLEST else 0.0 for v in np.asarray(values, dtype=float).reshape(3))
    return (x, y, z)


def rows(matrix: ArrayLike) -> Rows:
    """Three rows (3, 3) as such tuples."""
    a, b, c = map(vector, np.asarray(matrix, dtype=float).reshape(3, 3))
    return (a, b, c)


@dataclass(frozen=True)
class Pose:
    """Frame b in frame a: ``p_a = translation + rotation @ p_b`` (m; rotation as three rows)."""

    translation: Vector = (0.0, 0.0, 0.0)
    rotation: Rows = IDENTITY

    @staticmethod
    def of(translation: ArrayLike = (0.0, 0.0, 0.0), rotation: ArrayLike = IDENTITY) -> Pose:
        """Build from arrays of shapes (3,) and (3, 3)."""
        return Pose(vector(translation), rows(rotation))

    @property
    def p(self) -> NDArray[np.float64]:
        """Translation, shape (3,), m."""
        return np.array(self.translation)

    @property
    def r(self) -> NDArray[np.float64]:
        """Rotation matrix, shape (3, 3)."""
        return np.array(self.rotation)

    def __matmul__(self, other: Pose) -> Pose:
        return Pose.of(self.p + self.r @ other.p, self.r @ other.r)

    def inverse(self) -> Pose:
        """Frame a in frame b."""
        return Pose.of(-self.r.T @ self.p, self.r.T)
