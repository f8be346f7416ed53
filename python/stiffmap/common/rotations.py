"""Rotation matrices: about an axis, and as they are commanded."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats, trailing
from stiffmap.common.errors import StiffmapError

ORTHOGONAL = 1e-6  # entries of R^T R - I that the digits of an input may leave
EXACT = 1e-13


def as_rotations(r: Floats) -> Floats:
    """Matrices (..., 3, 3) as rotations: those that are off by the digits of the input are replaced by the
    nearest rotation, poses that are not finite are kept. StiffmapError for anything else."""
    r = trailing(r, (3, 3), "rotation", "rotation matrices")
    finite = np.asarray(np.isfinite(r).all(axis=(-2, -1)))
    with np.errstate(invalid="ignore", over="ignore"):
        off, mirrored = _off(r)
        mirrored &= finite
    bad = np.where(finite & ((off > ORTHOGONAL) | mirrored), np.maximum(off, 1e-300), 0.0)
    if np.any(bad):
        raise StiffmapError(
            f"rotation: expected rotation matrices, got one with |R^T R - I| = {np.max(bad):.1e}"
            f"{' and det < 0' if np.any(mirrored) else ''}"
        )
    rough = finite & (off > EXACT)
    if not np.any(rough):
        return r
    out = r.copy()
    u, _, v = np.linalg.svd(r[rough])
    out[rough] = u @ v
    return out


def _off(r: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Largest entry of |R^T R - I| of matrices (..., 3, 3), and whether they mirror; by columns, since numpy takes ten
    times as long for small products and determinants."""
    x, y, z = np.ascontiguousarray(np.moveaxis(r, (-1, -2), (0, 1)))
    off = np.zeros(r.shape[:-2])
    for a, b, one in ((x, x, 1.0), (y, y, 1.0), (z, z, 1.0), (x, y, 0.0), (x, z, 0.0), (y, z, 0.0)):
        off = np.maximum(off, np.abs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] - one))
    volume = (
        x[0] * (y[1] * z[2] - y[2] * z[1])
        + x[1] * (y[2] * z[0] - y[0] * z[2])
        + x[2] * (y[0] * z[1] - y[1] * z[0])
    )
    return off, np.asarray(volume < 0)


def rotation_about(axis: Floats, angle: float) -> Floats:
    """Rotation matrix (3, 3) about a unit vector (3,) by ``angle`` (rad), by Rodrigues' formula."""
    cosine, sine = math.cos(angle), math.sin(angle)
    # quarter turns exactly, so that frames of perpendicular axes stay free of 1e-17
    cosine, sine = (float(round(v)) if abs(v - round(v)) < 1e-15 else v for v in (cosine, sine))
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    matrix: Floats = np.eye(3) + sine * cross + (1.0 - cosine) * (cross @ cross)
    return matrix
