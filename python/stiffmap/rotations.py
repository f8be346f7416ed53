"""Check of commanded orientations."""

from __future__ import annotations

import numpy as np

from stiffmap.broadcasting import Floats
from stiffmap.errors import StiffmapError

ORTHOGONAL = 1e-9


def check_rotations(r: Floats) -> None:
    """StiffmapError unless all finite matrices (..., 3, 3) are rotations."""
    finite = np.asarray(np.isfinite(r).all(axis=(-2, -1)))
    off = np.abs(np.swapaxes(r, -1, -2) @ r - np.eye(3)).max(axis=(-2, -1), initial=0)
    mirrored = np.linalg.det(np.where(finite[..., None, None], r, np.eye(3))) < 0
    bad = np.where(finite & ((off > ORTHOGONAL) | mirrored), np.maximum(off, 1e-300), 0.0)
    if np.any(bad):
        raise StiffmapError(
            f"rotation: expected rotation matrices, got one with |R^T R - I| = {np.max(bad):.1e}"
            f"{' and det < 0' if np.any(mirrored) else ''}"
        )
