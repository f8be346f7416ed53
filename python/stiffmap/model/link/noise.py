"""Noise of the field from its residuals: (20) of the paper by case, pooled where homogeneous; and whether it is independent
(docs/link.md §5).

What a rigid body does not explain in a finite-element field (warping, mesh, Saint-Venant) is smooth:
neighbours share it, so n nodes are worth fewer. An exponential correlation fitted by restricted
likelihood tells how many, and corrects the covariance (19) that independent noise would give.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize
from scipy.sparse import csr_matrix, eye as sparse_eye, kron
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist
from scipy.special import chdtrc, ndtr

from stiffmap.common.broadcasting import Floats
from stiffmap.model.link.rigidfit import design_matrix
from stiffmap.model.link.transport import Ints

HOMOGENEITY_LEVEL = 0.01


class FieldNoise(NamedTuple):
    """Standard deviation of one displacement component."""

    sigma: Floats  # (cases,) m, each case by itself
    dof: Ints  # (cases,) 3 n - 6 for the nodes kept
    used: Floats  # (cases,) m, what the covariance is built on
    used_dof: Floats  # (cases,) degrees of freedom behind `used`; inf when the noise is given
    homogeneity: float  # p-value of "all cases have the same sigma"; NaN when not testable
    pooled: bool


def estimate_noise(rss: Floats, dof: Ints, floor: Floats) -> FieldNoise:
    """Noise of each case from its residual sum of squares (m²), link (5).

    The cases are pooled, with the sum of their degrees of freedom, when Bartlett's test does not distinguish their
    variances at 1 %. ``floor`` (cases,) is the round-off of the field in m: below it a
    residual is not noise but arithmetic.
    """
    sigma = np.sqrt(rss / np.maximum(dof, 1))
    sized = np.maximum(sigma, floor)
    p = bartlett(sized**2, dof)
    pooled = bool(np.isnan(p) or p > HOMOGENEITY_LEVEL)
    if not pooled:
        return FieldNoise(sigma, dof, sized, dof.astype(float), p, False)
    common = np.sqrt(np.sum(dof * sized**2) / np.sum(dof))
    full = np.ones(len(rss))
    return FieldNoise(sigma, dof, common * full, float(np.sum(dof)) * full, p, True)


def bartlett(variance: Floats, dof: Ints) -> float:
    """p-value of Bartlett's test that independent variances with these degrees of freedom are equal.

    NaN for a single case or when all variances are at zero.
    """
    k, total = len(variance), float(np.sum(dof))
    if k < 2 or not np.all(variance > 0) or np.any(dof < 1):
        return float("nan")
    common = float(np.sum(dof * variance) / total)
    statistic = total * np.log(common) - float(np.sum(dof * np.log(variance)))
    correction = 1 + (float(np.sum(1 / dof)) - 1 / total) / (3 * (k - 1))
    return float(chdtrc(k - 1, statistic / correction))


LEVEL = 1e-3
NEIGHBOURS = 6
FIT_NODES, COVARIANCE_NODES = 250, 1000


class Correlation(NamedTuple):
    """Spatial correlation of the residuals of all load cases together."""

    p_value: float  # of independence by Moran's I, cases combined
    correlated: bool  # p below 1e-3
    length: float  # m, of exp(-distance / length); 0 when independent
    inflation: Floats  # (6,) factor on the variance of the twist at the centroid
    effective_nodes: float  # n / mean(inflation)
    repetition: float  # largest |correlation| between the residual fields of two cases


def analyse_correlation(points: Floats, residuals: Floats) -> Correlation:
    """Moran's test and, where it rejects independence, the fitted correlation.

    Args:
        points: (n, 3) m; residuals: (cases, n, 3) m of the rigid-body fits on these nodes.
    """
    n = len(points)
    energy = np.sum(residuals**2, axis=(1, 2))
    live = residuals[energy > 0]
    none = Correlation(1.0, False, 0.0, np.ones(6), float(n), 0.0)
    if n <= NEIGHBOURS + 3 or len(live) == 0:
        return none
    z = _moran(points, live)
    p = float(ndtr(-z.sum() / np.sqrt(len(z))))
    unit = live.reshape(len(live), -1) / np.sqrt(energy[energy > 0])[:, None]
    cross = np.abs(unit @ unit.T - np.eye(len(live))).max() if len(live) > 1 else 0.0
    tested = none._replace(p_value=p, repetition=float(cross))
    if p > LEVEL:
        return tested
    length, nugget = _fit_exponential(points, live)
    inflation = _inflation(points, length, nugget)
    return tested._replace(
        correlated=True, length=length, inflation=inflation, effective_nodes=float(n / inflation.mean())
    )


def _moran(points: Floats, residuals: Floats) -> Floats:
    """z-score of Moran's I per case; moments of the ratio of quadratic forms are exact for
    residuals of a least-squares fit, which are not exchangeable.
    """
    n = len(points)
    near = np.asarray(cKDTree(points).query(points, k=NEIGHBOURS + 1)[1])
    rows = np.repeat(np.arange(n), NEIGHBOURS)
    half = csr_matrix((np.ones(len(rows)), (rows, near[:, 1:].ravel())), shape=(n, n))
    W = kron((half + half.T) / (2 * NEIGHBOURS), sparse_eye(3)).tocsr()
    Q = np.linalg.qr(design_matrix(points, points.mean(axis=0)).reshape(-1, 6))[0]
    WQ = np.asarray(W @ Q)
    inner, nu = Q.T @ WQ, 3 * n - 6
    trace = -np.trace(inner)
    trace2 = float(np.sum(W.data**2)) - 2 * float(np.sum(WQ**2)) + float(np.sum(inner * inner.T))
    mean = trace / nu
    variance = (trace**2 + 2 * trace2) / (nu * (nu + 2)) - mean**2
    r = residuals.reshape(len(residuals), -1)
    moran = np.sum(r * np.asarray(W @ r.T).T, axis=1) / np.sum(r**2, axis=1)
    return np.asarray((moran - mean) / np.sqrt(variance))


def _subset(points: Floats, limit: int) -> np.ndarray:
    if len(points) <= limit:
        return np.arange(len(points))
    order = np.lexsort(points.T)
    return np.sort(order[np.random.default_rng(0).choice(len(points), limit, replace=False)])


def _fit_exponential(points: Floats, residuals: Floats) -> tuple[float, float]:
    """Length and nugget by restricted maximum likelihood, one variance per case profiled out."""
    keep = _subset(points, FIT_NODES)
    p, u = points[keep], residuals[:, keep]
    distance = cdist(p, p)
    extent, spacing = distance.max(), np.partition(distance, 1, axis=1)[:, 1].mean()
    A = design_matrix(p, p.mean(axis=0))
    A[:, :, 3:] /= extent
    n, nu = len(p), 3 * len(p) - 6

    def cost(x: Floats) -> float:
        R = _exponential(distance, float(np.exp(x[0])), float(1 / (1 + np.exp(-x[1]))))
        factor = cho_factor(R, lower=True)
        RA = cho_solve(factor, A.reshape(n, 18)).reshape(n, 3, 6)
        M = np.einsum("nia,nib->ab", A, RA)
        Ru = cho_solve(factor, u.transpose(1, 0, 2).reshape(n, -1)).reshape(n, len(u), 3)
        Au = np.einsum("nia,nki->ka", A, Ru)
        rss = np.einsum("kni,nki->k", u, Ru) - np.einsum("ka,ab,kb->k", Au, np.linalg.inv(M), Au)
        logdet = 6 * np.sum(np.log(np.diag(factor[0]))) + np.linalg.slogdet(M)[1]
        return float(nu * np.sum(np.log(rss)) + len(u) * logdet)

    starts = [(np.log(s), g) for s in np.geomspace(spacing, extent, 5) for g in (-3.0, 0.0)]
    best = min(starts, key=lambda s: cost(np.array(s)))
    # A length beyond the region cannot be seen in residuals, from which the rigid motion was taken.
    bounds = [(np.log(spacing / 5), np.log(extent)), (-9.0, 6.0)]
    found = minimize(cost, best, method="Nelder-Mead", bounds=bounds, options={"maxiter": 60}).x
    return float(np.exp(found[0])), float(1 / (1 + np.exp(-found[1])))


def _exponential(distance: Floats, length: float, nugget: float) -> Floats:
    R: Floats = (1 - nugget) * np.exp(-distance / length)
    np.fill_diagonal(R, 1.0)
    return R


def _inflation(points: Floats, length: float, nugget: float) -> Floats:
    """(6,) true over naive variance of the twist at the centroid, the bias of sigma included."""
    keep = _subset(points, COVARIANCE_NODES)
    p = points[keep]
    R = _exponential(cdist(p, p), length, nugget)
    A = design_matrix(p, p.mean(axis=0))
    normal = np.einsum("nia,nib->ab", A, A)
    ARA = np.einsum("nia,nib->ab", A, np.einsum("nm,mia->nia", R, A))
    inverse = np.linalg.inv(normal)
    expected_rss = 3 * len(p) - np.trace(inverse @ ARA)
    ratio = np.diag(inverse @ ARA @ inverse) / np.diag(inverse)
    # The information saturates: a sub-sample has the same effective number of nodes as the field.
    return np.asarray(ratio * (3 * len(p) - 6) / expected_rss * len(points) / len(p))
