"""Equilibria under a force that turns in a plane, and its weakest and strongest direction; `stiffmap.polar`.

The squared deflection over the force's angle is a trigonometric polynomial of degree 2 for a linear
machine, whatever its deflection without the force. Values and slopes at the sampled directions fix
one of degree (samples - 1, at most 11); the equilibrium at its extremum is then solved, and the
most extreme of all equilibria is the answer. Nothing that is reported is interpolated or linearised.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Unpack

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from stiffmap.common.broadcasting import Floats, whole_number
from stiffmap.solve.labels import meaning
from stiffmap.solve.machine import Machine, takes_machine
from stiffmap.solve.options import LoadingKeywords, spelled_out
from stiffmap.solve.solution import Solution
from stiffmap.workspace.maps.inputs import magnitude, place, plane_axes
from stiffmap.workspace.maps.loading import (
    Loading,
    apply,
    at_place,
    describe,
    displaced,
    dot,
    norm,
    without_failed,
)

Parts = tuple[int, ...]
ALL: Parts = (0, 1, 2)


@dataclass(frozen=True)
class DirectionSweep:
    """Equilibria of poses (p) under force directions (k)."""

    angle: Floats  # (p, k) rad, from the plane's first axis to its second
    translation: Floats  # (p, k, 3) m; NaN where the status is not CONVERGED
    turning: Floats  # (p, k, 3) m/rad: change of the translation with the angle, by the loaded compliance
    growing: Floats  # (p, k, 3) m/N: change of the translation with the force's magnitude
    status: NDArray[np.uint8]  # (p, k)

    def sizes(self, parts: Parts) -> tuple[Floats, Floats]:
        """(p, k) m and m/N: norm of these components of the translation, and its change with the force; where there is no
        translation, the length of its change."""
        d, growing = self.translation[..., parts], self.growing[..., parts]
        size = norm(d)
        with np.errstate(invalid="ignore", divide="ignore"):
            return size, np.where(size > 0, dot(d, growing) / size, norm(growing))

    def join(self, other: DirectionSweep) -> DirectionSweep:
        """Directions of both."""
        pairs = ((getattr(self, n), getattr(other, n)) for n in self.__dataclass_fields__)
        return DirectionSweep(*(np.concatenate(pair, axis=1) for pair in pairs))

    def pick(self, column: NDArray[np.intp]) -> DirectionSweep:
        """One direction per pose, column (p,)."""
        row = np.arange(len(column))
        return DirectionSweep(*(getattr(self, n)[row, column][:, None] for n in self.__dataclass_fields__))


def direction(angle: Floats, axes: tuple[int, int]) -> Floats:
    """Unit vectors (..., 3)."""
    out = np.zeros((*angle.shape, 3))
    out[..., axes[0]], out[..., axes[1]] = np.cos(angle), np.sin(angle)
    return out


def direction_sweep_of(s: Solution, angle: Floats, size: Floats, axes: tuple[int, int]) -> DirectionSweep:
    """Equilibria (p, k) that have been solved for forces of those sizes (N) and angles."""
    along, across = direction(angle, axes), direction(angle + np.pi / 2, axes)
    c = s.compliance[..., :3, :3]
    moved = without_failed(s.displacement[..., :3], s.status)
    return DirectionSweep(angle, moved, size[..., None] * apply(c, across), apply(c, along), s.status)


def even_angles(count: int) -> Floats:
    """Equally spaced angles (rad) from 0."""
    return np.asarray(2 * np.pi / count * np.arange(count), dtype=float)


SCAN = 72
MAX_DEGREE = 11
NEWTON_STEPS = 5


@dataclass(frozen=True)
class Extreme:
    """The most extreme direction of each pose (p,); NaN where any direction failed."""

    angle: Floats  # rad, in [-pi, pi)
    value: Floats  # norm of the components looked at, m
    growth: Floats  # change of the value with the force, m/N
    status: NDArray[np.uint8]  # highest status among all directions solved


STEPS = 8
CLOSE = 1e-3
"""Relative distance to the tolerance from which one more Newton step is exact to about its square."""


@dataclass(frozen=True)
class TurningForce:
    """A pure force that turns in a plane, at poses (p)."""

    loading: Loading
    position: Floats  # (p, 3) m
    size: float  # N
    axes: tuple[int, int]  # base axes of the plane

    def solve(
        self, angle: Floats, size: Floats | None = None, rows: NDArray[np.intp] | None = None
    ) -> DirectionSweep:
        """Equilibria at angles (p, k); with a size (p,) N of its own for each pose, at some rows of the poses."""
        position = self.position if rows is None else self.position[rows]
        sizes = np.broadcast_to(np.reshape(self.size if size is None else size, (-1, 1)), angle.shape)
        along = direction(angle, self.axes)
        wrench = np.concatenate([sizes[..., None] * along, np.zeros_like(along)], axis=-1)
        return direction_sweep_of(self.loading.solve(position[:, None], wrench), angle, sizes, self.axes)

    def extreme(self, directions: DirectionSweep, parts: tuple[int, ...], sign: int) -> Extreme:
        """Largest (sign 1) or smallest (-1) norm of the components `parts` of the translation."""
        d, rate = directions.translation[..., parts], directions.turning[..., parts]
        angle = peak_angle(sign * dot(d, d), sign * 2 * dot(d, rate))
        directions = directions.join(self.solve(angle[:, None]))
        value = norm(directions.translation[..., parts])
        best = directions.pick(np.argmax(np.where(np.isnan(value), -np.inf, sign * value), axis=1))
        failed = np.isnan(value).any(axis=1)
        angle = np.mod(best.angle + np.pi, 2 * np.pi) - np.pi
        angle, size, growth = (np.where(failed, np.nan, a[:, 0]) for a in (angle, *best.sizes(parts)))
        return Extreme(angle, size, growth, directions.status.max(axis=1))

    def extremes(
        self, directions: DirectionSweep, plane: str
    ) -> Iterator[tuple[str, Parts, Extreme, Extreme]]:
        """Suffix of names, components, worst and best direction: of the whole translation, then in the plane."""
        for suffix, parts in (("", ALL), (f"_{plane}", self.axes)):
            worst, best = (self.extreme(directions, parts, sign) for sign in (1, -1))
            yield suffix, parts, worst, best

    def limit(self, worst: Extreme, parts: tuple[int, ...], tolerance: float) -> Floats:
        """Force (p,) in N along the worst direction at which the deflection reaches the tolerance (m).

        Newton's method on loaded equilibria, started at the worst direction's own. 0 where the tolerance
        is exceeded without any force; NaN where an equilibrium on the way fails.
        """
        limit = newton_step(np.full(len(self.position), self.size), worst.value, worst.growth, tolerance)
        open_ = np.abs(worst.value - tolerance) > CLOSE * tolerance
        for _ in range(STEPS):
            rows = np.flatnonzero(open_ & (limit > 0))
            if rows.size == 0:
                return limit
            f = self.solve(worst.angle[rows, None], limit[rows], rows)
            value, growth = (a[:, 0] for a in f.sizes(parts))
            limit[rows] = newton_step(limit[rows], value, growth, tolerance)
            open_[rows] = np.abs(value - tolerance) > CLOSE * tolerance
        return np.where(open_ & (limit > 0), np.nan, limit)


def newton_step(force: Floats, value: Floats, growth: Floats, tolerance: float) -> Floats:
    """Next force, not below zero; NaN where the deflection does not grow."""
    with np.errstate(invalid="ignore", divide="ignore"):
        step = np.where(growth > 0, (tolerance - value) / growth, np.nan)
    return np.asarray(np.maximum(force + step, 0.0))


def peak_angle(value: Floats, slope: Floats) -> Floats:
    """Angle (p,) of the maximum of the polynomial through values and slopes (p, k) at even angles."""
    count = value.shape[1]
    coefficients = dot(np.concatenate([value, slope], axis=1)[:, None, :], _fit(count)[None])
    c = np.where(np.isfinite(coefficients).all(axis=1, keepdims=True), coefficients, 0.0)
    scan, degree = even_angles(SCAN), min(count - 1, MAX_DEGREE)
    at = dot(c[:, None, :], _basis(scan, degree))
    # Of two peaks the higher one may lie between points of the scan, and the other on one: each is refined.
    pose, point = np.nonzero((at >= np.roll(at, 1, axis=1)) & (at >= np.roll(at, -1, axis=1)))
    peak = _refined(c[pose], scan[point], degree)
    height = np.full(at.shape, -np.inf)
    height[pose, point] = dot(c[pose], _basis(peak, degree))
    angle = np.empty(at.shape)
    angle[pose, point] = peak
    return np.take_along_axis(angle, np.argmax(height, axis=1)[:, None], axis=1)[:, 0]


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
    angle, degree = even_angles(count), min(count - 1, MAX_DEGREE)
    rows = np.concatenate([_basis(angle, degree), _basis(angle, degree, 1)])
    return np.asarray(np.linalg.pinv(rows))


@takes_machine
@spelled_out(LoadingKeywords)
def polar(
    machine: Machine,
    position: ArrayLike,
    force: float = 300.0,
    plane: str = "xy",
    *,
    directions: int = 72,
    **given: Unpack[LoadingKeywords],
) -> xr.Dataset:
    """Deflection against the direction of a pure force in a plane, at one position.

    position (3,) m; force N; `directions` equally spaced directions from the plane's first axis
    towards its second, each a loaded equilibrium. Other keywords as in `Machine.solve`.

    Returns a Dataset with dimension ``angle`` (rad): displacement, deflection, deflection_xy, status,
    flags, and the scalars worst_deflection, worst_direction, best_deflection, best_direction (whole
    translation; with ``_xy`` in the plane) searched between the directions. Failed directions hold NaN
    and their status. Raises StiffmapError for bad input.
    """
    loading = Loading(machine, **given)
    p, axes = place(position), plane_axes(plane)
    force = magnitude(force, "force", "N")
    directions = whole_number(directions, "directions", 3)
    angle = even_angles(directions)
    wrench = np.concatenate([force * direction(angle, axes), np.zeros((directions, 3))], axis=1)
    s = loading.solve(p[None, None], wrench[None])
    swept = direction_sweep_of(s, angle[None], np.full((1, directions), force), axes)
    turning = TurningForce(loading, p[None], force, axes)
    d = without_failed(s.displacement, s.status)[0]
    data = displaced("angle", d, s.status[0], s.flags[0], plane)
    for suffix, _, worst, best in turning.extremes(swept, plane):
        for word, size, e in (("worst", "largest", worst), ("best", "smallest", best)):
            what = f"{size} deflection over the force directions of the {plane} plane"
            data[f"{word}_deflection{suffix}"] = ((), e.value[0], meaning("m", what))
            data[f"{word}_direction{suffix}"] = ((), e.angle[0], meaning("rad", "direction of that force"))
    turned = meaning("rad", f"direction of the force, from {plane[0]} towards {plane[1]}")
    coords = at_place(p) | {
        "angle": ("angle", angle, turned),
        "force": ((), force, meaning("N", "magnitude of the force")),
    }
    call = {"function": "polar", "position": p, "force": force, "plane": plane, "directions": directions}
    return xr.Dataset(data, coords, describe(loading, "polar diagram", call))
