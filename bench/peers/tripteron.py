"""The shipped Tripteron in closed form, for programs that know nothing of stiffmap (SI)."""

from __future__ import annotations

import numpy as np

LENGTH, DIAMETER, YOUNG, SHEAR, DRIVE, SIZE = 0.75, 0.15, 7.0e10, 2.55e10, 1.0e6, 0.9
AREA = np.pi * DIAMETER**2 / 4
INERTIA = np.pi * DIAMETER**4 / 64
POLAR = 2 * INERTIA
X, Y, Z = np.eye(3)

# axes of each leg (columns: local x, y, z; the slider runs along z) and origin
LEGS = (
    (np.column_stack([X, Y, Z]), np.zeros(3)),
    (np.column_stack([Z, -Y, X]), SIZE * Y),
    (np.column_stack([X, -Z, Y]), SIZE * Z),
)


def joints(p: np.ndarray, leg: int) -> np.ndarray:
    """Slider and the three angles of a leg at the platform position p, elbow angle positive."""
    axes, origin = LEGS[leg]
    x, y, z = axes.T @ (p - origin)
    reach = np.hypot(x, y)
    half = np.arccos(reach / (2 * LENGTH))
    first = np.arctan2(y, x) - half
    return np.array([z, first, 2 * half, -first - 2 * half])


def corners(p: np.ndarray, leg: int) -> np.ndarray:
    """(3, 3) m: slider, elbow and tip of a leg."""
    axes, origin = LEGS[leg]
    z, first, elbow, _ = joints(p, leg)
    a = np.array([0, 0, z])
    b = a + LENGTH * np.array([np.cos(first), np.sin(first), 0])
    c = b + LENGTH * np.array([np.cos(first + elbow), np.sin(first + elbow), 0])
    return origin + np.stack([a, b, c]) @ axes.T


def link_stiffness() -> np.ndarray:
    """(6, 6): free end of an Euler-Bernoulli cantilever along x."""
    n, ei, gj = LENGTH, YOUNG * INERTIA, SHEAR * POLAR
    k = np.diag([YOUNG * AREA / n, 12 * ei / n**3, 12 * ei / n**3, gj / n, 4 * ei / n, 4 * ei / n])
    k[1, 5] = k[5, 1] = -6 * ei / n**2
    k[2, 4] = k[4, 2] = 6 * ei / n**2
    return k


def grid(n: int) -> np.ndarray:
    """(n^3, 3) m, 1/18 of the workspace away from its faces."""
    g = np.linspace(SIZE / 18, SIZE - SIZE / 18, n)
    return np.stack(np.meshgrid(g, g, g, indexing="ij"), -1).reshape(-1, 3)
