"""Motions of the tool over time: lines, circles, tables of points; SI (docs/measures.md)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from os import PathLike

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from stiffmap.common.broadcasting import Floats, real_array
from stiffmap.common.errors import StiffmapError


@dataclass(frozen=True, eq=False)
class Path:
    """A geometric path over s from 0 to 1: positions and their derivatives at samples."""

    s: Floats
    """(n,) increasing from 0 to 1."""
    position: Floats
    """(n, 3) m."""
    first: Floats
    """(n, 3) dp/ds."""
    second: Floats
    """(n, 3) d²p/ds²."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Motion of the TCP; the platform keeps its orientation."""

    time: Floats
    """(n,) s, increasing."""
    position: Floats
    """(n, 3) m."""
    velocity: Floats
    """(n, 3) m/s."""
    acceleration: Floats
    """(n, 3) m/s²."""
    force: Floats
    """(n, 3) N on the tool."""

    def __post_init__(self) -> None:
        n = len(self.time)
        for name in ("position", "velocity", "acceleration", "force"):
            value = getattr(self, name)
            if value.shape != (n, 3) or not np.isfinite(value).all():
                raise StiffmapError(
                    f"trajectory: expected finite {name} of shape ({n}, 3), got {value.shape}"
                )
        if n < 2 or not (np.diff(self.time) > 0).all():
            raise StiffmapError("trajectory: expected two or more times that increase")

    def with_force(self, force: ArrayLike) -> Trajectory:
        """The same motion with a force (3,) or (n, 3) N on the tool."""
        return replace(self, force=np.broadcast_to(real_array(force, "force"), self.position.shape).copy())


def line(start: ArrayLike, end: ArrayLike, points: int = 201) -> Path:
    """Straight path from start to end (3,) m."""
    a, b = real_array(start, "start"), real_array(end, "end")
    if a.shape != (3,) or b.shape != (3,) or not np.linalg.norm(b - a) > 0:
        raise StiffmapError(f"line: expected two different points (3,) in m, got {start!r} and {end!r}")
    s = np.linspace(0, 1, points)
    one = np.ones((points, 1))
    return Path(s, a + s[:, None] * (b - a), one * (b - a), 0 * one * (b - a))


def circle(centre: ArrayLike, radius: float, plane: str = "xy", points: int = 401) -> Path:
    """One turn about `centre` (3,) m in a plane of the base axes."""
    from stiffmap.workspace.maps.inputs import plane_axes

    c = real_array(centre, "centre")
    if c.shape != (3,) or not radius > 0:
        raise StiffmapError(f"circle: expected a centre (3,) and a radius in m, got {centre!r}, {radius!r}")
    i, j = plane_axes(plane)
    s = np.linspace(0, 1, points)
    turn = 2 * np.pi
    out = [np.zeros((points, 3)) for _ in range(3)]
    for axis, phase in ((i, 0.0), (j, -np.pi / 2)):
        for order, values in enumerate(out):
            values[:, axis] = radius * turn**order * np.cos(turn * s + phase + order * np.pi / 2)
    return Path(s, c + out[0], out[1], out[2])


def way_along(points: Floats) -> Floats:
    """(n,) m along the chords of points (n, 3) m, from the first."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def through(points: ArrayLike, samples: int = 401) -> Path:
    """Smooth path (cubic spline over the chord length) through points (k, 3) m."""
    p = real_array(points, "points")
    if p.ndim != 2 or p.shape[1] != 3 or len(p) < 2 or not np.isfinite(p).all():
        raise StiffmapError(f"path: expected two or more finite points (k, 3) in m, got shape {p.shape}")
    steps = np.linalg.norm(np.diff(p, axis=0), axis=1)
    if not (steps > 0).all():
        raise StiffmapError(
            f"path: points {int(np.argmin(steps)) + 1} and {int(np.argmin(steps)) + 2} coincide"
        )
    at = np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum()
    if len(p) == 2:
        return line(p[0], p[1], samples)
    spline = CubicSpline(at, p)
    s = np.linspace(0, 1, samples)
    return Path(s, spline(s), spline(s, 1), spline(s, 2))


def run_along(path: Path, time: Floats, rate: Floats, square: Floats, bend: Floats) -> Trajectory:
    """At each sample of a path the time (s), ds/dt, its square and d²s/dt²; no force on the tool."""
    return Trajectory(
        time=time,
        position=path.position,
        velocity=path.first * rate[:, None],
        acceleration=path.second * square[:, None] + path.first * bend[:, None],
        force=np.zeros_like(path.position),
    )


def timed(path: Path, duration: float) -> Trajectory:
    """A path run from rest to rest in `duration` s (a polynomial of degree 7: no jump of acceleration or jerk)."""
    if not duration > 0:
        raise StiffmapError(f"duration: expected a positive time in s, got {duration!r}")
    u = np.linspace(0, 1, len(path.s))
    smooth = np.polynomial.Polynomial([0, 0, 0, 0, 35, -84, 70, -20])
    s = smooth(u)
    spline = [CubicSpline(path.s, values) for values in (path.position, path.first, path.second)]
    rate, bend = smooth.deriv()(u) / duration, smooth.deriv(2)(u) / duration**2
    there = Path(s, *(f(s) for f in spline))
    return run_along(there, u * duration, rate, rate**2, bend)


def at_feed(path: Path, feed: float) -> Trajectory:
    """A path run at a constant speed (m/s) all the way: it begins and ends in motion."""
    if not (np.isfinite(feed) and feed > 0):
        raise StiffmapError(f"feed: expected a positive speed in m/s, got {feed!r}")
    size = np.linalg.norm(path.first, axis=1)
    if not (size > 0).all():
        raise StiffmapError("feed: the path stands still somewhere, so it has no direction there")
    step = np.diff(path.s) * (size[1:] + size[:-1]) / 2
    time = np.concatenate([[0.0], np.cumsum(step)]) / feed
    rate = feed / size  # ds/dt
    bend = -(path.first * path.second).sum(axis=1) / size**2 * rate**2  # d²s/dt²: the speed stays
    return run_along(path, time, rate, rate**2, bend)


def read_points(file: str | PathLike[str], unit: str = "mm") -> Path:
    """Path through the rows x, y, z of a table; `unit` of columns that name none. FileError names row and column."""
    from pathlib import Path as FilePath

    from stiffmap.common.tables.named import Known, read_named

    axes = dict.fromkeys("xyz", "m")
    table = read_named(FilePath(file), Known(axes, {}, {}, assumed=dict.fromkeys("xyz", unit)))
    if lost := [a for a in axes if a not in table.values]:
        table.fail(f"no column {lost[0]}; expected x, y, z ({unit})")
    return through(table.block("xyz"))
