"""Arrays of the link modules; a compliance and its covariance at another reference point (docs/link.md §2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats

Ints = NDArray[np.int64]


def skew(vectors: Floats) -> Floats:
    """Cross-product matrices S(v), (..., 3) -> (..., 3, 3), so that ``S(v) @ w == cross(v, w)``."""
    return np.asarray(np.cross(np.eye(3), np.asarray(vectors, dtype=float)[..., None, :]))


def standard_errors(covariance: Floats) -> Floats:
    """(6, 6) standard errors of the entries whose covariance (36, 36), row-major, is given."""
    return np.asarray(np.sqrt(np.maximum(np.diag(covariance), 0.0)).reshape(6, 6))


def unit_diagonal(matrix: Floats) -> Floats:
    """(6, 6) matrix over the square roots of its diagonal terms; those that are zero count as one."""
    size = np.sqrt(np.abs(np.diag(matrix)))
    size = np.where(size > 0, size, 1.0)
    return np.asarray(matrix / np.outer(size, size))


def twist_transport(shift: Floats) -> Floats:
    """(6, 6) matrix T that takes a twist to the point moved by ``shift`` (3,) m, link (10).

    ``t' = t + phi x shift``. Dead wrenches go the other way: ``W = T^T W'``.
    """
    T = np.eye(6)
    T[:3, 3:] = -skew(np.asarray(shift, dtype=float))
    return T


def transport_compliance(compliance: Floats, covariance: Floats, shift: Floats) -> tuple[Floats, Floats]:
    """Compliance (6, 6) and covariance (36, 36) at the point moved by ``shift`` (3,) m.

    ``C' = T C T^T`` and, row-major, ``V' = (T ⊗ T) V (T ⊗ T)^T``: link (11).
    """
    T = twist_transport(shift)
    TT = np.kron(T, T)
    return T @ compliance @ T.T, TT @ covariance @ TT.T
