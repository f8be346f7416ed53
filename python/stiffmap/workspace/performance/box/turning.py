"""How to turn the box so that a larger one fits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats
from stiffmap.workspace.performance.box.box_search import BoxSearch
from stiffmap.workspace.performance.limits.limits import Bounds

STARTS = 6
TRIALS = 40


def best_orientation(bounds: Bounds, shape: Floats, region: Floats, gap: float) -> Floats:
    """(3, 3) axes of the box, by a simplex search over rotation vectors from several starts, corners only.

    A local answer: the bounds of `largest_box` hold for the orientation that is returned.
    """
    size = float(np.max(region[1] - region[0]))

    def minus_edge(vector: Floats) -> float:
        axes = Rotation.from_rotvec(vector).as_matrix()
        search = BoxSearch(
            replace(bounds, counter=[0]), shape, axes, turned(region, axes), 1e-3 * size, 10**9
        )
        return -search.estimate()[1]

    rng = np.random.default_rng(0)
    starts = np.concatenate([np.zeros((1, 3)), rng.uniform(-np.pi / 4, np.pi / 4, (STARTS - 1, 3))])
    first = sorted(starts, key=minus_edge)[:2]
    found = [
        minimize(minus_edge, s, method="Nelder-Mead",
                 options={"maxfev": TRIALS, "initial_simplex": s + 0.2 * np.vstack([np.zeros(3), np.eye(3)])})
        for s in first
    ]  # fmt: skip
    best = min(found, key=lambda f: float(f.fun))
    if -best.fun <= -minus_edge(np.zeros(3)) + 2 * gap:
        return np.eye(3)
    return np.asarray(Rotation.from_rotvec(best.x).as_matrix())


def turned(region: Floats, axes: Floats) -> Floats:
    """(2, 3) box along `axes` about a box along the base axes."""
    low, high = region
    centre, half = axes.T @ ((low + high) / 2), np.abs(axes.T) @ (high - low) / 2
    return np.stack([centre - half, centre + half])
