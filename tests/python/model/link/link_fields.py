"""Fields of a rigid motion with independent noise, and a coupled bar's compliance."""

from __future__ import annotations

import numpy as np

L, EIZ, EIY, EA, GJ = 0.31, 43.0, 205.0, 6.8e6, 10.8


def bar_compliance() -> np.ndarray:
    """Euler-Bernoulli cantilever along x, at its tip: the sizes of Table 1's original bar, SI."""
    C = np.diag([L / EA, L**3 / (3 * EIZ), L**3 / (3 * EIY), L / GJ, L / EIY, L / EIZ])
    C[1, 5] = C[5, 1] = L**2 / (2 * EIZ)
    C[2, 4] = C[4, 2] = -(L**2) / (2 * EIY)
    return C


def rigid_field(C, wrenches, points, reference):
    """(cases, n, 3) of the linear motion phi x p, written with numpy's cross product only."""
    twists = wrenches @ C.T
    return np.array([x[:3] + np.cross(x[3:], points - reference) for x in twists])


WRENCHES = np.diag([1000.0, 10.0, 10.0, 1.0, 1.0, 1.0])
REFERENCE = np.array([L, 0.0, 0.0])


def end_nodes(n: int, seed: int = 7) -> np.ndarray:
    """(n, 3) nodes near the end of the bar; their centroid is 10 mm short of the reference point."""
    return np.array([0.3, 0, 0]) + np.random.default_rng(seed).uniform(-1, 1, (n, 3)) * [0.01, 0.012, 0.02]


def noisy_field(n: int = 80, sigma: float = 2e-8, seed: int = 2, wrenches: np.ndarray = WRENCHES):
    """Nodes and the noisy field of the bar's compliance."""
    points = end_nodes(n)
    clean = rigid_field(bar_compliance(), wrenches, points, REFERENCE)
    return points, clean + sigma * np.random.default_rng(seed).standard_normal(clean.shape)
