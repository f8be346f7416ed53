"""Rotation about an axis."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray


def rotation_about(axis: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """Rotation matrix (3, 3) about a unit vector (3,) by ``angle`` (rad), by Rodrigues' formula."""
    cosine, sine = math.cos(angle), math.sin(angle)
    # quarter turns exactly, so that frames of perpendicular axes stay free of 1e-17
    cosine, sine = (float(round(v)) if abs(v - round(v)) < 1e-15 else v for v in (cosine, sine))
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    matrix: NDArray[np.float64] = np.eye(3) + sine * cross + (1.0 - cosine) * (cross @ cross)
    return matrix
