"""Does the matrix look like a link's spring: definiteness and lengths, each with its number."""

from __future__ import annotations

import numpy as np

from stiffmap.link.arrays import Floats


def smallest_eigenvalue(compliance: Floats, covariance: Floats) -> tuple[float, float]:
    """Smallest eigenvalue of C scaled to a unit diagonal, and its standard error (first order)."""
    size = np.sqrt(np.abs(np.diag(compliance)))
    size = np.where(size > 0, size, 1.0)
    unit = 1 / np.outer(size, size)
    value, vector = np.linalg.eigh((compliance + compliance.T) / 2 * unit)
    g = (np.outer(vector[:, 0], vector[:, 0]) * unit).ravel()
    return float(value[0]), float(np.sqrt(max(float(g @ covariance @ g), 0.0)))


def bending_lengths(compliance: Floats) -> dict[str, float]:
    """Lengths in m that a prismatic cantilever along x would have, by ratio of the entries.

    ``sqrt(3 k22/k66)`` and ``sqrt(3 k33/k55)`` from the diagonal, ``2 k26/k66`` and ``-2 k35/k55`` from the
    coupling: all four equal the length of an ideal bar. NaN where a ratio is negative.
    """
    k = compliance
    with np.errstate(invalid="ignore", divide="ignore"):
        return {
            "sqrt(3 k22/k66)": float(np.sqrt(3 * k[1, 1] / k[5, 5])),
            "sqrt(3 k33/k55)": float(np.sqrt(3 * k[2, 2] / k[4, 4])),
            "2 k26/k66": float(2 * k[1, 5] / k[5, 5]),
            "-2 k35/k55": float(-2 * k[2, 4] / k[4, 4]),
        }


def findings(compliance: Floats, covariance: Floats) -> list[str]:
    """One line per property: positive diagonal, definiteness, lengths of an equivalent bar."""
    if np.isnan(compliance).any():
        return ["definiteness: not known, part of the matrix is not identified"]
    lines = []
    bad = [f"k{i + 1}{i + 1}" for i in range(6) if compliance[i, i] <= 0]
    lines.append("diagonal: " + (f"NOT positive: {', '.join(bad)}" if bad else "positive"))
    value, error = smallest_eigenvalue(compliance, covariance)
    verdict = (
        "positive definite"
        if value > 2 * error
        else "NOT positive definite"
        if value < -2 * error
        else "open"
    )
    lines.append(f"definiteness: {verdict}; smallest eigenvalue at unit diagonal {value:.4g} ± {error:.1g}")
    lengths = ", ".join(f"{k} = {1e3 * v:.1f} mm" for k, v in bending_lengths(compliance).items())
    lines.append(f"as a cantilever along x (equal when prismatic and slender): {lengths}")
    return lines
