"""Weakest and strongest direction of a force that turns in a plane.

The squared deflection over the force's angle is a trigonometric polynomial of degree 2 for a linear
machine, whatever its deflection without the force. Values and slopes at the sampled directions fix
one of degree (samples - 1, at most 11); the equilibrium at its extremum is then solved, and the
most extreme of all equilibria is the answer. Nothing that is reported is interpolated or linearised.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.workspace.maps.direction_sweep import DirectionSweep, even_angles, solve_directions
from stiffmap.workspace.maps.fixed_order_sums import dot, norm
from stiffmap.workspace.maps.loading import Loading

SCAN = 72
MAX_DEGREE = 11
NEWTON_STEPS = 5


@dataclass(frozen=True)
class Extreme:
    """The most extreme direction of each pose (p,); NaN where any direction failed."""

    angle: Floats
    """rad, in [-pi, pi)."""
    value: Floats
    """Norm of the components looked at, m."""
    growth: Floats
    """Change of the value with the force, m/N."""
    status: NDArray[np.uint8]
    """Highest status among all directions solved."""


def find_extreme(
    loading: Loading,
    position: Floats,
    force: float,
    axes: tuple[int, int],
    directions: DirectionSweep,
    parts: tuple[int, ...],
    sign: int,
) -> Extreme:
    """Largest (sign 1) or smallest (-1) norm of the components `parts` of the translation."""
    d, rate = directions.translation[..., parts], directions.turning[..., parts]
    angle = peak_angle(sign * dot(d, d), sign * 2 * dot(d, rate))
    both = directions.join(solve_directions(loading, position, angle[:, None], force, axes))
    return most_extreme(both, parts, sign)


def most_extreme(directions: DirectionSweep, parts: tuple[int, ...], sign: int) -> Extreme:
    """The direction whose components `parts` are largest or smallest."""
    value = norm(directions.translation[..., parts])
    best = directions.pick(np.argmax(np.where(np.isnan(value), -np.inf, sign * value), axis=1))
    failed = np.isnan(value).any(axis=1)
    size = norm(best.translation[..., parts])[:, 0]
    growth = value_growth(best.translation[..., parts], best.growing[..., parts])[:, 0]
    angle = np.mod(best.angle[:, 0] + np.pi, 2 * np.pi) - np.pi
    angle, size, growth = (np.where(failed, np.nan, a) for a in (angle, size, growth))
    return Extreme(angle, size, growth, directions.status.max(axis=1))


def value_growth(d: Floats, growing: Floats) -> Floats:
    """Change of |d| with the force; at d = 0 the length of the change itself."""
    size = norm(d)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(size > 0, dot(d, growing) / size, norm(growing))


def peak_angle(value: Floats, slope: Floats) -> Floats:
    """Angle (p,) of the maximum of the polynomial through values and slopes (p, k) at even angles."""
    count = value.shape[1]
    coefficients = dot(np.concatenate([value, slope], axis=1)[:, None, :], _fit(count)[None])
    c = np.where(np.isfinite(coefficients).all(axis=1, keepdims=True), coefficients, 0.0)
    scan, degree = even_angles(SCAN), _degree(count)
    at = dot(c[:, None, :], _basis(scan, degree))
    # Of two peaks the higher one may lie between points of the scan, and the other on one: each is refined.
    pose, point = np.nonzero((at >= np.roll(at, 1, axis=1)) & (at >= np.roll(at, -1, axis=1)))
    peak = _refined(c[pose], scan[point], degree)
    height = np.full(at.shape, -np.inf)
    height[pose, point] = dot(c[pose], _basis(peak, degree))
    angle = np.empty(at.shape)
    angle[pose, point] = peak
    return np.take_along_axis(angle, np.argmax(height, axis=1)[:, None], axis=1)[:, 0]


def _degree(count: int) -> int:
    return min(count - 1, MAX_DEGREE)


def _refined(c: Floats, angle: Floats, degree: int) -> Floats:
    limit = 2 * np.pi / SCAN
    start = angle
    for _ in range(NEWTON_STEPS):
        first, second = (dot(c, _basis(angle, degree, order)) for order in (1, 2))
        with np.errstate(invalid="ignore", divide="ignore"):
            step = np.where(second < 0, -first / second, 0.0)
        angle = np.clip(angle + step, start - limit, start + limit)
    return angle


def _basis(angle: Floats, degree: int, order: int = 0) -> Floats:
    """1, cos, sin, cos 2a, sin 2a, … (..., 2 degree + 1), differentiated `order` times."""
    n = np.arange(1, degree + 1)
    phase = angle[..., None] * n + order * np.pi / 2
    waves = np.stack([np.cos(phase), np.sin(phase)], axis=-1) * (n.astype(float) ** order)[:, None]
    constant = np.full((*angle.shape, 1), 0.0 if order else 1.0)
    return np.concatenate([constant, waves.reshape(*angle.shape, -1)], axis=-1)


@lru_cache
def _fit(count: int) -> NDArray[np.float64]:
    """Least-squares coefficients from values and slopes: (2 degree + 1, 2 count)."""
    angle, degree = even_angles(count), _degree(count)
    rows = np.concatenate([_basis(angle, degree), _basis(angle, degree, 1)])
    return np.asarray(np.linalg.pinv(rows))
