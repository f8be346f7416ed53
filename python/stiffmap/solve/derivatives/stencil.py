"""Differences of second order: central, one-sided next to a bound."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stiffmap.common.broadcasting import Floats


@dataclass(frozen=True)
class Stencil:
    """Derivative = sum of ``weights[1:]`` times the values at ``offsets``, and ``weights[0]`` times the base's."""

    offsets: tuple[float, float]
    weights: tuple[float, float, float]

    def combine(self, base: Floats, values: Sequence[Floats]) -> Floats:
        """The derivative from the base's value and those at the offsets, all (...)."""
        w = self.weights
        moved = w[1] * values[0] + w[2] * values[1]
        return np.asarray(moved if w[0] == 0 else moved + w[0] * base)


def central(step: float) -> Stencil:
    """Error step²/6 times the third derivative."""
    return Stencil((-step, step), (0.0, -0.5 / step, 0.5 / step))


def within(value: float, step: float, lower: float, upper: float) -> Stencil:
    """Central where both sides are inside the bounds, else one-sided with error step²/3 times the third."""
    if value - step >= lower and value + step <= upper:
        return central(step)
    h = step if value - step < lower else -step
    return Stencil((h, 2 * h), (-1.5 / h, 2.0 / h, -0.5 / h))


def combine_all(stencils: Sequence[Stencil], base: Floats, values: Floats) -> Floats:
    """Derivatives (..., stencils, n) from the base's values (..., n) and all ends (..., 2 stencils, n)."""
    w = np.array([s.weights for s in stencils])[..., None]
    ends = values.reshape((*values.shape[:-2], len(stencils), 2, values.shape[-1]))
    out = ends[..., 0, :] * w[:, 1]
    out += ends[..., 1, :] * w[:, 2]
    if w[:, 0].any():
        out += base[..., None, :] * w[:, 0]
    return np.asarray(out)
