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
