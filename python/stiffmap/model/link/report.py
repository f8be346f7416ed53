"""Units in which a compliance is shown, and what the matrix itself says: definiteness, lengths of an equivalent bar."""

from __future__ import annotations

import numpy as np

from stiffmap.common.broadcasting import Floats

UNIT_FACTOR = np.kron([[1e3, 1.0], [1.0, 1e-3]], np.ones((3, 3)))
"""(6, 6) from SI entries to mm/N, 1/N, rad/(N·mm), as the paper prints them."""


def unit_name(i: int, j: int) -> str:
    """Unit of entry (i, j), zero-based: for example ``mm/N``."""
    return ("mm/N", "1/N", "rad/(N·mm)")[i // 3 + j // 3]


def smallest_eigenvalue(compliance: Floats, covariance: Floats) -> tuple[float, float]:
    """Smallest eigenvalue of C scaled to a unit diagonal, and its standard error (first order)."""
    size = np.sqrt(np.abs(np.diag(compliance)))
    size = np.where(size > 0, size, 1.0)
    unit = 1 / np.outer(size, size)
    value, vector = np.linalg.eigh((compliance + compliance.T) / 2 * unit)
    g = (np.outer(vector[:, 0], vector[:, 0]) * unit).ravel()
    return float(value[0]), float(np.sqrt(max(float(g @ covariance @ g), 0.0)))


def bending_lengths(compliance: Floats) -> tuple[str, dict[str, float]]:
    """Axis and lengths in m that a prismatic cantilever would have, by ratio of the entries.

    The axis is the stiffest translation, its sense that of the couplings. For one along x the lengths are
    ``sqrt(3 k22/k66)`` and ``sqrt(3 k33/k55)`` from the diagonal, ``2 k26/k66`` and ``-2 k35/k55`` from the
    couplings: all four equal the length of an ideal bar. NaN where a ratio is negative.
    """
    k = compliance
    axis = int(np.argmin(np.diag(k)[:3]))
    b, c = (axis + 1) % 3, (axis + 2) % 3
    sense = 1.0 if k[b, c + 3] - k[c, b + 3] >= 0 else -1.0
    lengths = {}
    with np.errstate(invalid="ignore", divide="ignore"):
        for across, turn in ((b, c + 3), (c, b + 3)):
            name = f"k{across + 1}{across + 1}/k{turn + 1}{turn + 1}"
            lengths[f"sqrt(3 {name})"] = float(np.sqrt(3 * k[across, across] / k[turn, turn]))
        for across, turn, sign in ((b, c + 3, sense), (c, b + 3, -sense)):
            name = f"k{across + 1}{turn + 1}/k{turn + 1}{turn + 1}"
            lengths[f"{'-' if sign < 0 else ''}2 {name}"] = float(sign * 2 * k[across, turn] / k[turn, turn])
    return f"{'-' if sense < 0 else ''}{'xyz'[axis]}", lengths


def findings(compliance: Floats, covariance: Floats) -> list[str]:
    """One line per property: positive diagonal, definiteness, lengths of an equivalent bar."""
    if np.isnan(compliance).any():
        return ["definiteness: not known, part of the matrix is not identified"]
    lines = []
    bad = [f"k{i + 1}{i + 1}" for i in range(6) if compliance[i, i] <= 0]
    lines.append("diagonal: " + (f"NOT positive: {', '.join(bad)}" if bad else "positive"))
    value, error = smallest_eigenvalue(compliance, covariance)
    sign = "positive definite" if value > 0 else "NOT positive definite"
    verdict = sign if abs(value) > 2 * error else "open"
    lines.append(f"definiteness: {verdict}; smallest eigenvalue at unit diagonal {value:.4g} ± {error:.1g}")
    axis, found = bending_lengths(compliance)
    lengths = ", ".join(f"{k} = {1e3 * v:.1f} mm" for k, v in found.items())
    lines.append(f"as a cantilever along {axis} (equal when prismatic and slender): {lengths}")
    return lines
