"""Compliance and its covariance at another reference point or in other axes (docs/link.md §2)."""

from __future__ import annotations

import numpy as np

from stiffmap.model.link.arrays import Floats, skew


def twist_transport(shift: Floats, rotation: Floats | None = None) -> Floats:
    """(6, 6) matrix T that takes a twist to the point moved by ``shift`` (3,) m, link (10).

    ``t' = t + phi x shift``; then both parts are expressed in new axes whose columns, in the old
    axes, are ``rotation`` (3, 3). Dead wrenches go the other way: ``W = T^T W'``.
    """
    T = np.eye(6)
    T[:3, 3:] = -skew(np.asarray(shift, dtype=float))
    if rotation is None:
        return T
    return np.kron(np.eye(2), np.asarray(rotation, dtype=float).T) @ T


def transport_compliance(
    compliance: Floats, covariance: Floats, shift: Floats, rotation: Floats | None = None
) -> tuple[Floats, Floats]:
    """Compliance (6, 6) and covariance (36, 36) at the point moved by ``shift`` (3,) m.

    ``C' = T C T^T`` and, row-major, ``V' = (T ⊗ T) V (T ⊗ T)^T``: link (11).
    """
    T = twist_transport(shift, rotation)
    TT = np.kron(T, T)
    return T @ compliance @ T.T, TT @ covariance @ TT.T
