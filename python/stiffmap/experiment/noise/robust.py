"""Linear models of readings some of which are far off: Student weights, iterated."""

from __future__ import annotations

import numpy as np

from stiffmap.experiment.experiment import Floats

DEGREES = 1.0
"""Of freedom: readings far off have no weight at all."""
ROUNDS, SETTLED = 50, 1e-3
"""Fits, and change of weights that ends them."""
LEAST = 1e-9
"""Share of the largest reading that is no spread."""
MOST = 100
"""Columns up to which a fit is robust; a zero of each of many poses is fitted plainly."""


def fitted(columns: Floats, values: Floats, rounds: int = ROUNDS) -> tuple[Floats, Floats]:
    """(p,) coefficients of columns (N, p) for values (N,) in noise, and (N,) what they leave in robust standard deviations, which
    are at least the noise; one round is plain least squares."""
    size = np.linalg.norm(columns, axis=0)
    scaled = columns / np.where(size > 0.0, size, 1.0)
    weights: Floats = np.ones(len(values))
    found: Floats = np.zeros(columns.shape[1])
    left, scale = values, 1.0
    for _ in range(rounds if columns.shape[1] <= MOST else 1):
        root = np.sqrt(weights)
        found = np.asarray(np.linalg.lstsq(scaled * root[:, None], values * root, rcond=1e-9)[0])
        left = np.abs(values - scaled @ found)
        scale = max(
            1.4826 * float(np.median(left)) if len(left) else 1.0,
            LEAST * np.abs(values).max(initial=0.0),
            1.0,
        )
        moved = (DEGREES + 1.0) / (DEGREES + (left / scale) ** 2)
        if np.abs(moved - weights).max(initial=0.0) < SETTLED:
            break
        weights = np.asarray(moved)
    return found / np.where(size > 0.0, size, 1.0), left / scale
