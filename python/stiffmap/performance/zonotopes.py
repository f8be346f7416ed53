"""Images of a box of drive values under a Jacobian: a zonotope, its vertices, its inscribed sphere."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np

from stiffmap.broadcasting import Floats


def corners(n: int) -> Floats:
    """(2^(n-1), n) signs, one of each pair of opposite corners of the cube."""
    return np.array([(1.0, *s) for s in product((1.0, -1.0), repeat=n - 1)])


def farthest_vertex(j: Floats) -> Floats:
    """(...) largest norm of J s over all corners s of the cube: exact, the norm being convex."""
    images = j @ corners(j.shape[-1]).T
    return np.asarray(np.sqrt((images**2).sum(axis=-2).max(axis=-1)))


def worst_corner(j: Floats) -> Floats:
    """(..., drives) the corner whose image is farthest."""
    signs = corners(j.shape[-1])
    images = j @ signs.T
    return np.asarray(signs[np.argmax((images**2).sum(axis=-2), axis=-1)])


def inverse_rows(j: Floats) -> Floats:
    """(..., drives, rows) pseudo-inverse: drive rates of a twist that the machine can do; NaN stays NaN."""
    out = np.full((*j.shape[:-2], j.shape[-1], j.shape[-2]), np.nan)
    ok = np.isfinite(j).all(axis=(-2, -1))
    if j.shape[-1] > j.shape[-2]:
        out[ok] = np.linalg.pinv(j[ok])
        return out
    a = j[ok]
    t = np.swapaxes(a, -1, -2)
    gram = t @ a
    scale = np.sqrt(np.einsum("...ii->...i", gram))
    with np.errstate(divide="ignore", invalid="ignore"):
        scaled = gram / (scale[..., :, None] * scale[..., None, :])
    sound = np.isfinite(scaled).all(axis=(-2, -1))
    sound[sound] = np.linalg.det(scaled[sound]) > 1e-8
    inverse = np.empty_like(t)
    first = np.linalg.solve(gram[sound], t[sound])
    # one correction makes up for the squared condition of the normal matrix
    inverse[sound] = first + np.linalg.solve(gram[sound], t[sound] - gram[sound] @ first)
    inverse[~sound] = np.linalg.pinv(a[~sound], rcond=1e-12)
    out[ok] = inverse
    return out


def inverse_rows_limit(j: Floats, limits: Floats) -> Floats:
    """(...) speed reached in every direction of the machine's own motions, drives within `limits`."""
    norms = np.linalg.norm(inverse_rows(j), axis=-1)
    with np.errstate(divide="ignore"):
        return np.asarray((limits / norms).min(axis=-1))


def inscribed_sphere(j: Floats) -> Floats:
    """(...) radius of the largest sphere in the image (…, 3, drives) of the unit cube.

    Each facet is parallel to two generators; its distance is the support of the zonotope along their
    normal. Square matrices reduce to the rows of the inverse.
    """
    n = j.shape[-1]
    best = np.full(j.shape[:-2], np.inf)
    for a, b in combinations(range(n), 2):
        normal = np.cross(j[..., a], j[..., b])
        size = np.linalg.norm(normal, axis=-1)
        with np.errstate(invalid="ignore", divide="ignore"):
            support = np.abs(np.einsum("...i,...in->...n", normal, j)).sum(axis=-1) / size
        best = np.fmin(best, np.where(size > 1e-14, support, np.inf))
    best = np.where(np.isfinite(j).all(axis=(-2, -1)), best, np.nan)
    return np.where(np.isinf(best), 0.0, best)
