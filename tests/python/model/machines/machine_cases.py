"""What is known of the shipped machines beforehand."""

from __future__ import annotations

import numpy as np

from stiffmap import Flag, Machine

# machine -> flags of every pose of its box
FLAGS = {
    "orthoglide-original": Flag(0),
    "orthoglide-revised": Flag(0),
    "hexapod": Flag.FREE_SPIN,
    "linear-delta": Flag.FREE_SPIN,
    "rotary-delta": Flag.FREE_SPIN,
    "hybrid": Flag.FREE_SPIN,
    "ur10": Flag(0),
    "five-bar": Flag(0),
    "swing-table": Flag(0),
    "3-rps": Flag(0),
    "travelling-column": Flag(0),
}
SPINS = {"hexapod": 6, "linear-delta": 6, "rotary-delta": 6, "hybrid": 6}


def box(machine: Machine, n: int = 3) -> np.ndarray:
    """(n^3, 3) m: grid over the workspace box, corners included."""
    low, high = machine.workspace
    axes = [np.linspace(a, b, n) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)


def turn(axis: str, angle: float) -> np.ndarray:
    """Rotation matrix about a base axis."""
    i = "xyz".index(axis)
    j, k = (i + 1) % 3, (i + 2) % 3
    matrix = np.eye(3)
    matrix[j, j] = matrix[k, k] = np.cos(angle)
    matrix[k, j], matrix[j, k] = np.sin(angle), -np.sin(angle)
    return matrix
