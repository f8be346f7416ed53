"""The force that a tolerance allows."""

from __future__ import annotations

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.workspace.maps.direction_sweep import solve_directions
from stiffmap.workspace.maps.extremes import Extreme, value_growth
from stiffmap.workspace.maps.fixed_order_sums import norm
from stiffmap.workspace.maps.loading import Loading

STEPS = 8
CLOSE = 1e-3
"""Relative distance to the tolerance from which one more Newton step is exact to about its square."""


def force_limit(
    loading: Loading,
    position: Floats,
    force: float,
    axes: tuple[int, int],
    worst: Extreme,
    parts: tuple[int, ...],
    tolerance: float,
) -> Floats:
    """Force (p,) in N along the worst direction at which the deflection reaches the tolerance (m).

    Newton's method on loaded equilibria, started at the worst direction's own. 0 where the tolerance
    is exceeded without any force; NaN where an equilibrium on the way fails.
    """
    limit = newton_step(np.full(len(position), force), worst.value, worst.growth, tolerance)
    open_ = np.abs(worst.value - tolerance) > CLOSE * tolerance
    for _ in range(STEPS):
        rows = np.flatnonzero(open_ & (limit > 0))
        if rows.size == 0:
            return limit
        f = solve_directions(loading, position[rows], worst.angle[rows, None], limit[rows], axes)
        value = norm(f.translation[..., parts])[:, 0]
        growth = value_growth(f.translation[..., parts], f.growing[..., parts])[:, 0]
        limit[rows] = newton_step(limit[rows], value, growth, tolerance)
        open_[rows] = np.abs(value - tolerance) > CLOSE * tolerance
    return np.where(open_ & (limit > 0), np.nan, limit)


def newton_step(force: Floats, value: Floats, growth: Floats, tolerance: float) -> Floats:
    """Next force, not below zero; NaN where the deflection does not grow."""
    with np.errstate(invalid="ignore", divide="ignore"):
        step = np.where(growth > 0, (tolerance - value) / growth, np.nan)
    return np.asarray(np.maximum(force + step, 0.0))
