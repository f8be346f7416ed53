"""The direction in which a force of a given size pushes the tool furthest."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.compiled import Status
from stiffmap.solve.machine import Machine

STEPS, SETTLED = 50, 1e-9


def worst_force(machine: Machine, position: ArrayLike, size: float, **options: Any) -> Floats:
    """Force (3,) N of ``size`` N in space that moves the point furthest, at one pose (m).

    ``options`` as in `Machine.solve`. Solved are ± the principal directions of the unloaded
    translational compliance C; the worst one is improved by f <- size Cᵀd / |Cᵀd|, the ascent of |d|² on
    the sphere, each step a loaded equilibrium. Where nothing is found (unreachable), the force is along x.
    """
    unloaded = machine.solve(position, np.zeros(6), **options).compliance[:3, :3]
    if not np.isfinite(unloaded).all():
        return np.array([size, 0.0, 0.0])
    principal = np.linalg.svd(unloaded)[2]
    tried = [_push(machine, position, s * size * u, options) for u in principal for s in (1.0, -1.0)]
    far, force, gradient = max(tried, key=lambda t: t[0])
    for _ in range(STEPS):
        if not np.isfinite(gradient).all() or not gradient.any():
            break
        new = _push(machine, position, size * gradient / np.linalg.norm(gradient), options)
        if not new[0] > far * (1 + SETTLED):
            break
        far, force, gradient = new
    return force


def _push(machine: Machine, position: ArrayLike, force: Floats, options: Any) -> tuple[float, Floats, Floats]:
    """How far (m; -1 where there is no stable equilibrium), the force, half the gradient of |d|²."""
    s = machine.solve(position, np.r_[force, np.zeros(3)], **options)
    if int(s.status) != Status.CONVERGED:
        return -1.0, force, np.full(3, np.nan)
    d = s.displacement[:3]
    return float(np.linalg.norm(d)), force, s.compliance[:3, :3].T @ d


def greatest(c: Floats) -> Floats:
    """(...) greatest singular value of matrices (..., 3, 3), NaN where one is not finite."""
    bad = np.asarray(~np.isfinite(c).all(axis=(-1, -2)))
    square = np.swapaxes(c, -1, -2) @ c
    scale = np.abs(square).max(axis=(-1, -2))
    safe = np.where(bad | (scale == 0), 1.0, scale)
    values = _largest_eigenvalue(np.where(bad[..., None, None], 0.0, square) / safe[..., None, None])
    out = np.sqrt(np.maximum(values * np.where(scale == 0, 0.0, safe), 0.0))
    return np.asarray(np.where(bad, np.nan, out))


def _largest_eigenvalue(a: Floats) -> Floats:
    """(...) of symmetric matrices (..., 3, 3), by the closed form with the cosine of a third of an angle."""
    mean = np.trace(a, axis1=-2, axis2=-1) / 3
    b = a - mean[..., None, None] * np.eye(3)
    p = np.sqrt((b * b).sum(axis=(-1, -2)) / 6)
    safe = np.where(p > 0, p, 1.0)
    b = b / safe[..., None, None]
    half_det = (
        b[..., 0, 0] * (b[..., 1, 1] * b[..., 2, 2] - b[..., 1, 2] * b[..., 2, 1])
        - b[..., 0, 1] * (b[..., 1, 0] * b[..., 2, 2] - b[..., 1, 2] * b[..., 2, 0])
        + b[..., 0, 2] * (b[..., 1, 0] * b[..., 2, 1] - b[..., 1, 1] * b[..., 2, 0])
    ) / 2
    return np.asarray(mean + 2 * p * np.cos(np.arccos(np.clip(half_det, -1.0, 1.0)) / 3))
