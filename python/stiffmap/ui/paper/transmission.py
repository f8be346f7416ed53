"""Velocity transmission factors of a machine, from its own kinematics."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.machine import Machine

STEP = 1e-5
"""m; the central difference then errs by about 1e-9."""


def jacobian(machine: Machine, position: Floats) -> Floats:
    """TCP velocity per drive velocity, (..., 3, 3), by central differences of the inverse kinematics."""
    p = np.asarray(position)[..., None, :]
    shift = STEP * np.eye(3)
    ahead, behind = (inverse_kinematics(machine, p + s).actuators for s in (shift, -shift))
    return np.asarray(np.linalg.inv(np.swapaxes((ahead - behind) / (2 * STEP), -1, -2)))


def factors(machine: Machine, position: Floats) -> Floats:
    """Singular values (..., 3) of the Jacobian, descending."""
    return np.asarray(np.linalg.svd(jacobian(machine, position), compute_uv=False))


def diagonal_limits(machine: Machine, low: float, high: float, reach: float) -> tuple[float, float]:
    """Ends (m) of the part of x = y = z around 0 in which all factors lie within low … high.

    `reach`: how far to look on either side, m.
    """

    def excess(q: float) -> float:
        f = factors(machine, np.full(3, q))
        return float(min(high - f[0], f[-1] - low))

    low_end, high_end = (float(brentq(excess, 0.0, side * reach, xtol=1e-9)) for side in (-1, 1))
    return low_end, high_end


def box_factors(machine: Machine, box: Floats, count: int = 5) -> tuple[float, float]:
    """Least and largest factor over a grid of count³ positions in a box (2, 3), corners included."""
    axes = [np.linspace(box[0, i], box[1, i], count) for i in range(3)]
    f = factors(machine, np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1))
    return float(f.min()), float(f.max())
