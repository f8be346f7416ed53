"""Compliance from the twists of the load cases: weighted least squares for (8), docs/link.md §3."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import pinvh

from stiffmap.common.broadcasting import Floats, Mask


class Regression(NamedTuple):
    """Row-major compliance entries as a linear function of the stacked twists."""

    entries: Floats  # (36,)
    gain: Floats  # (cases, 36, 6): entries = sum_k gain[k] @ twist[k]
    covariance: Floats  # (36, 36)
    lack_of_fit: float  # chi-square of what the cases contradict each other
    lack_dof: int


def regress(wrenches: Floats, twists: Floats, covariances: Floats) -> Regression:
    """Weighted least squares for ``twist_k = C wrench_k + e_k``, ``cov e_k = covariances[k]``: link (6).

    It is ``k = [t; phi] [F; M]^+``, the transpose of what the paper's (8) prints, when all cases have
    the same covariance. Directions that no wrench excites get the minimum-norm zero.

    Args:
        wrenches: (cases, 6); twists: (cases, 6); covariances: (cases, 6, 6), positive definite.
    """
    scale_w = np.linalg.norm(wrenches, axis=0)
    scale_w = np.where(scale_w > 0, scale_w, 1.0)
    scale_x = np.sqrt(np.mean([np.diag(c) for c in covariances], axis=0))
    w = wrenches / scale_w
    weight = np.linalg.inv(covariances / np.outer(scale_x, scale_x))
    normal = np.einsum("kab,ki,kj->aibj", weight, w, w).reshape(36, 36)
    inverse = pinvh(normal, rtol=1e-12)
    unit = np.kron(scale_x, 1 / scale_w)
    pairs = zip(weight, w, strict=True)
    gain = np.array([unit[:, None] * (inverse @ np.kron(Q, wk[:, None])) / scale_x for Q, wk in pairs])
    entries = np.einsum("kea,ka->e", gain, twists)
    left = (twists - wrenches @ entries.reshape(6, 6).T) / scale_x
    chi = float(np.einsum("ka,kab,kb->", left, weight, left))
    rank = int(np.linalg.matrix_rank(w, tol=1e-9 * float(np.linalg.norm(w, 2))))
    return Regression(entries, gain, inverse * np.outer(unit, unit), chi, 6 * (len(w) - rank))


def structure(*, symmetric: bool, zeros: Mask | None = None, known: Mask | None = None) -> Floats:
    """(36, parameters) matrix Z with ``entries = Z @ parameters``: link (7).

    Entry (i, j) and (j, i) share a parameter under symmetry; ``zeros`` (6, 6) take theirs away;
    ``known`` (6, 6) leaves out parameters of which no entry was measured.
    """
    columns = []
    for i in range(6):
        for j in range(i if symmetric else 0, 6):
            column = np.zeros((6, 6), dtype=bool)
            column[i, j] = True
            column |= column.T & symmetric
            if not (zeros is not None and zeros[column].any()) and (known is None or known[column].any()):
                columns.append(column.ravel().astype(float))
    return np.array(columns).T if columns else np.zeros((36, 0))


def constrain(covariance: Floats, Z: Floats, measured: Mask) -> Floats:
    """(36, 36) projection P: ``P @ entries`` is the best estimate of the form Z @ parameters, link (7).

    Generalised least squares with the entries' own covariance; rows of unmeasured entries not used.
    """
    if Z.shape[1] == 0:
        return np.zeros((36, 36))
    V = covariance[np.ix_(measured, measured)]
    size = np.sqrt(np.diag(V))
    inverse = np.linalg.inv(V / np.outer(size, size))
    Zm = Z[measured] / size[:, None]
    unit = np.linalg.norm(Zm, axis=0)
    Zn = Zm / unit
    gain = np.linalg.solve(Zn.T @ inverse @ Zn, Zn.T @ inverse) / size
    P = np.zeros((36, 36))
    P[:, measured] = (Z / unit) @ gain
    return P
