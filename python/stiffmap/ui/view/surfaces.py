"""Surfaces at the tool: how far it is pushed by a force in every direction."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats

RINGS, SECTORS = 24, 48


@cache
def sphere() -> tuple[Floats, NDArray[np.uint32]]:
    """Vertices (n, 3) and triangles (m, 3) of a unit sphere."""
    a = np.linspace(0, np.pi, RINGS + 1)[:, None]
    b = np.linspace(0, 2 * np.pi, SECTORS, endpoint=False)[None]
    points = np.stack([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a) + 0 * b], axis=-1)
    i, j = np.meshgrid(np.arange(RINGS), np.arange(SECTORS), indexing="ij")
    right = (j + 1) % SECTORS
    p, q, r, s = (u * SECTORS + v for u, v in ((i, j), (i + 1, j), (i + 1, right), (i, right)))
    faces = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((p, q, r), (p, r, s))])
    return points.reshape(-1, 3), faces.astype(np.uint32)


def polar_surface(compliance: Floats, size: float) -> tuple[Floats, float]:
    """Vertices relative to the tool, and the deflection (m/N) that the longest stands for.

    In each direction u of a force the distance is the deflection |C u|; the longest is drawn `size` (m).
    """
    u, _ = sphere()
    far = np.linalg.norm(u @ compliance.T, axis=1)
    most = float(far.max())
    return np.asarray(u * far[:, None] * (size / most if most > 0 else 0.0)), most


def ellipsoid(compliance: Floats, size: float) -> tuple[Floats, float]:
    """The same of the displacements C u themselves: an ellipsoid."""
    u, _ = sphere()
    d = u @ compliance.T
    most = float(np.linalg.norm(d, axis=1).max())
    return np.asarray(d * (size / most if most > 0 else 0.0)), most


def principal(compliance: Floats) -> tuple[Floats, Floats]:
    """Principal compliances (3,) m/N, the largest first, and their directions (3, 3) as rows."""
    values, vectors = np.linalg.eigh((compliance + compliance.T) / 2)
    return np.asarray(values[::-1]), np.asarray(vectors.T[::-1])
