"""Nodes that do not move with the body: found all at once, so no order of removal exists (docs/link.md §4).

A least-trimmed-squares start (half the nodes may be wrong) is refined to the fixed point of
"fit the inliers, then judge every node again". Nodes are first put in a canonical order, so the
answer is the same for any numbering of the nodes.
"""

from __future__ import annotations

import numpy as np
from scipy.special import chdtri

from stiffmap.common.broadcasting import Floats, Mask
from stiffmap.model.link.rigidfit import design_matrix

LEVEL = 0.01  # probability that a clean field of independent noise loses any node
STARTS = 200
SMALLEST_FIELD = 9  # below this the residuals cannot tell an outlier from noise
ROUNDS = 50


def find_outliers(points: Floats, displacements: Floats, level: float, sigma: float | None) -> Mask:
    """(n,) bool, True for a node that leaves the rigid motion of the others.

    A node is an outlier when its residual, standardised by its own covariance (leverage included),
    exceeds the chi-square(3) quantile that a clean field passes with probability ``1 - level``.

    Args:
        points: (n, 3) m.
        displacements: (n, 3) m, one load case.
        level: family-wise level over the nodes.
        sigma: known noise in m, else estimated from the inliers.
    """
    n = len(points)
    if n < SMALLEST_FIELD:
        return np.zeros(n, dtype=bool)
    order = np.lexsort(points.T)
    A = design_matrix(points[order], points.mean(axis=0))
    A[:, :, 3:] /= np.abs(A[:, :, 3:]).max()
    u = displacements[order]
    floor = 1e-12 * float(np.abs(u).max(initial=0.0))
    found = _refine(A, u, _trimmed_start(A, u), float(chdtri(3, level / n)), floor, sigma)
    outliers = np.zeros(n, dtype=bool)
    outliers[order] = found
    return outliers


def _trimmed_start(A: Floats, u: Floats) -> Mask:
    """Inliers (half of the nodes) of the least-trimmed-squares fit, best of random elemental starts."""
    n, half = len(u), (len(u) + 7) // 2
    normal, right = np.einsum("nia,nib->nab", A, A), np.einsum("nia,ni->na", A, u)
    rng = np.random.default_rng(0)
    member = np.zeros((STARTS, n))
    np.put_along_axis(member, np.argsort(rng.random((STARTS, n)), axis=1)[:, :4], 1.0, axis=1)
    for _ in range(4):  # concentration steps: the trimmed sum never grows
        M = np.tensordot(member, normal, axes=1) + 1e-9 * np.eye(6)
        x = np.linalg.solve(M, (member @ right)[..., None])[..., 0]
        d2 = np.sum((u - np.einsum("nia,sa->sni", A, x)) ** 2, axis=2)
        best = np.argpartition(d2, half - 1, axis=1)[:, :half]
        member = np.zeros((STARTS, n))
        np.put_along_axis(member, best, 1.0, axis=1)
    return np.asarray(member[np.argmin(np.sum(d2 * member, axis=1))] > 0)


def _refine(A: Floats, u: Floats, inlier: Mask, cut: float, floor: float, sigma: float | None) -> Mask:
    n = len(u)
    d2 = _squared_residuals(A, u, np.flatnonzero(inlier))
    scale2 = sigma**2 if sigma else max(float(np.median(d2) / chdtri(3, 0.5)), floor**2)
    seen: list[Mask] = []
    for _ in range(ROUNDS):
        if scale2 == 0.0:
            return np.zeros(n, dtype=bool)
        judged = _standardised(A, u, inlier) <= cut * scale2
        if judged.sum() < max(SMALLEST_FIELD, n // 2):
            break
        if any(np.array_equal(judged, s) for s in seen):
            return ~judged
        seen.append(inlier := judged)
        if not sigma:
            rss = float(_squared_residuals(A, u, np.flatnonzero(inlier))[inlier].sum())
            scale2 = max(rss / (3 * int(inlier.sum()) - 6), floor**2)
    return ~inlier


def _squared_residuals(A: Floats, u: Floats, keep: np.ndarray) -> Floats:
    x = np.linalg.lstsq(A[keep].reshape(-1, 6), u[keep].ravel(), rcond=1e-10)[0]
    return np.asarray(np.sum((u - A @ x) ** 2, axis=1))


def _standardised(A: Floats, u: Floats, inlier: Mask) -> Floats:
    """Squared residual of every node in the metric of its own covariance, m² (noise variance left in)."""
    Ai = A[inlier].reshape(-1, 6)
    N = np.linalg.inv(Ai.T @ Ai)
    r = u - A @ (N @ (Ai.T @ u[inlier].ravel()))
    lever = np.einsum("nia,ab,njb->nij", A, N, A)
    sign = np.where(inlier, -1.0, 1.0)  # inside the fit the residual is smaller, outside larger
    over = np.linalg.solve(np.eye(3) + sign[:, None, None] * lever, r[..., None])[..., 0]
    return np.asarray(np.einsum("ni,ni->n", r, over))
