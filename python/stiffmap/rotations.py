"""Rotation matrices: about an axis, and as they are commanded."""

from __future__ import annotations

import math

import numpy as np

from stiffmap.broadcasting import Floats
from stiffmap.errors import StiffmapError

ORTHOGONAL = 1e-6  # entries of R^T R - I that the digits of an input may leave
EXACT = 1e-13


def as_rotations(r: Floats) -> Floats:
    """Matrices (..., 3, 3) as rotations: those that are off by the digits of the input are replaced by the
    nearest rotation, poses that are not finite are kept. StiffmapError for anything else."""
    finite = np.asarray(np.isfinite(r).all(axis=(-2, -1)))
    off = np.abs(np.swapaxes(r, -1, -2) @ r - np.eye(3)).max(axis=(-2, -1), initial=0)
    mirrored = np.linalg.det(np.where(finite[..., None, None], r, np.eye(3))) < 0
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


def rotation_about(axis: Floats, angle: float) -> Floats:
    """Rotation matrix (3, 3) about a unit vector (3,) by ``angle`` (rad), by Rodrigues' formula."""
    cosine, sine = math.cos(angle), math.sin(angle)
    # quarter turns exactly, so that frames of perpendicular axes stay free of 1e-17
    cosine, sine = (float(round(v)) if abs(v - round(v)) < 1e-15 else v for v in (cosine, sine))
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    matrix: Floats = np.eye(3) + sine * cross + (1.0 - cosine) * (cross @ cross)
    return matrix
