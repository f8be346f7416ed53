"""Images of a box of drive values under a Jacobian: a zonotope, its vertices, its inscribed sphere."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np

from stiffmap.common.broadcasting import Floats

SOUND = 1e-8
"""Least determinant of a scaled normal matrix that is inverted as it is."""


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
    sound[sound] = np.linalg.det(scaled[sound]) > SOUND
    if sound.all():
        out[ok] = _by_normal_matrix(gram, t)
        return out
    inverse = np.empty_like(t)
    inverse[sound] = _by_normal_matrix(gram[sound], t[sound])
    inverse[~sound] = np.linalg.pinv(a[~sound], rcond=1e-12)
    out[ok] = inverse
    return out


def _by_normal_matrix(gram: Floats, t: Floats) -> Floats:
    """gram^-1 t; one correction makes up for the squared condition of the normal matrix."""
    inverse = symmetric_inverse(gram)
    first = inverse @ t
    return np.asarray(first + inverse @ (t - gram @ first))


def symmetric_inverse(a: Floats) -> Floats:
    """(..., n, n) inverse of symmetric matrices; of three rows by their minors, which is quicker for many."""
    if a.shape[-1] != 3:
        return np.asarray(np.linalg.inv(a))
    p, q, r, s, t, u = (a[..., i, j] for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)))
    c = s * u - t * t, r * t - q * u, q * t - r * s
    det = p * c[0] + q * c[1] + r * c[2]
    e, f, g = p * u - r * r, q * r - p * t, p * s - q * q
    return (
        np.stack([c[0], c[1], c[2], c[1], e, f, c[2], f, g], axis=-1).reshape(a.shape) / det[..., None, None]
    )


def rows_limit(inverse: Floats, limits: Floats) -> Floats:
    """(...) speed reached in every direction of the machine's own motions, drives within `limits`."""
    with np.errstate(divide="ignore"):
        return np.asarray((limits / np.linalg.norm(inverse, axis=-1)).min(axis=-1))


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
