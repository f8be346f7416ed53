"""Motions of the tool over time: lines, circles, tables of points; SI (docs/measures.md).

Time-optimal speed is by reachability analysis (Pham and Pham, IEEE Transactions on Robotics 34, 2018): backward and forward
passes over the squared path speed; at each sample the drives' limits are half-planes in (path acceleration u, squared path speed x).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from stiffmap.common.broadcasting import Floats, real_array, refused
from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import place_text
from stiffmap.solve.machine import Machine
from stiffmap.workspace.maps.inputs import plane_axes
from stiffmap.workspace.performance.motion.closing import drive_kinematics, drive_values, refuse_failed
from stiffmap.workspace.performance.motion.inertia import (
    PUSHES,
    friction_efforts,
    held,
    in_cables,
    inertia_columns,
    need_masses,
    rigid_dynamics,
)


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
                raise refused("trajectory", f"finite {name} of shape ({n}, 3)", str(value.shape))
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
        i = int(np.argmin(steps))
        raise StiffmapError(f"path: points {i + 1} and {i + 2} coincide")
    if len(p) == 2:
        return line(p[0], p[1], samples)
    spline = CubicSpline(way_along(p) / steps.sum(), p)
    s = np.linspace(0, 1, samples)
    return Path(s, spline(s), spline(s, 1), spline(s, 2))


def run_along(path: Path, time: Floats, rate: Floats, square: Floats, bend: Floats) -> Trajectory:
    """At each sample of a path the time (s), ds/dt, its square and d²s/dt²; no force on the tool."""
    velocity = path.first * rate[:, None]
    acceleration = path.second * square[:, None] + path.first * bend[:, None]
    return Trajectory(time, path.position, velocity, acceleration, np.zeros_like(path.position))


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


BISECTIONS = 60
FASTEST = 1e6


def fastest(
    machine: Machine,
    path: Path,
    *,
    rotation: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    speed: float = np.inf,
    force: ArrayLike = (0.0, 0.0, 0.0),
    threads: int | None = None,
) -> Trajectory:
    """The quickest run along a path, from rest to rest, within the drives' speeds and efforts.

    Efforts are affine in the path's acceleration and squared speed; the largest squared speed at each
    sample follows from one pass backward and one forward (time-optimal path parametrisation by
    reachability). Friction is charged at the sense of the motion, its viscous part at the drive's
    highest speed so that the limits hold. `speed`: m/s along the path; `force` (3,) N on the tool.
    """
    need_masses(machine, "a time-optimal trajectory")
    force = real_array(force, "force")
    k = drive_kinematics(machine, path.position, rotation, threads=threads)
    refuse_failed(machine, k, None, path.position)
    limits = drive_values(machine, "force", None, "N or N·m")
    h = in_cables(machine, "a time-optimal run")
    a, b, c, rate = _terms(machine, k.coordinates, path, gravity, force, threads)
    speeds = drive_values(machine, "speed", None, "m/s or rad/s")
    least, most = (friction_efforts(machine, np.sign(rate) * size) for size in (1e-12, speeds))
    # the speed is not known yet: friction counts where it hinders, at its largest, and where it helps, at its least
    if h is not None:
        moved = inertia_columns(h, k.rotation) @ np.stack([path.first, path.second], axis=-1)
        pushed = np.broadcast_to((PUSHES @ force)[:, None], (*moved.shape[:-1], 1))
        rows, room, offset = held(machine, h, k, np.concatenate([-moved, pushed], axis=-1), limits, gravity)
        a, b, c = rows[..., 0], rows[..., 1], rows[..., 2] + offset
        low, high = -room - c, room - c
    else:
        low, high = -limits - c - np.minimum(least, most), limits - c - np.maximum(least, most)
    with np.errstate(divide="ignore"):
        top = ((speeds / np.abs(rate)) ** 2).min(axis=1)
        top = np.minimum(top, (speed / np.linalg.norm(path.first, axis=1)) ** 2)
    over = ((low > 0) | (high < 0)).any(axis=1)
    if over.any():
        place = place_text(path.position[int(np.argmax(over))], ".1f")
        raise StiffmapError(f"{machine.name}: its drives cannot hold the load at {place} of the path")
    step = np.diff(path.s)
    x = _passes(step, a, b, low, high, np.minimum(top, FASTEST))
    root = np.sqrt(x)
    spans = 2 * step / (root[1:] + root[:-1])
    if not np.isfinite(spans).all():
        place = place_text(path.position[int(np.argmax(~np.isfinite(spans)))], ".1f")
        raise StiffmapError(f"the drives cannot move the tool along the path at {place}")
    u = np.append(np.diff(x) / (2 * step), 0.0)
    return run_along(path, np.concatenate([[0.0], np.cumsum(spans)]), root, x, u)


def _terms(
    machine: Machine, coordinates: Floats, path: Path, gravity: ArrayLike | None, force: Floats, threads: int | None
) -> tuple[Floats, Floats, Floats, Floats]:  # fmt: skip
    """efforts = a u + b x + c along the path, and drive rates per path speed, each (n, drives)."""
    zero = np.zeros_like(path.first)
    first, second = np.hstack([path.first, zero]), np.hstack([path.second, zero])
    still = np.zeros_like(first)
    wrench = np.hstack([np.broadcast_to(force, zero.shape), zero])

    def efforts(twist: Floats, rate: Floats, load: Floats, g: ArrayLike | None) -> dict[str, Floats]:
        return rigid_dynamics(machine, coordinates, twist, rate, load, g, threads)

    c = efforts(still, still, wrench, gravity)["effort"]
    rest = efforts(still, still, still, np.zeros(3))["effort"]
    a = efforts(still, first, still, np.zeros(3))["effort"] - rest
    moving = efforts(first, second, still, np.zeros(3))
    return a, moving["effort"] - rest, c, moving["rate"]


def _range(x: Floats | float, a: Floats, b: Floats, low: Floats, high: Floats) -> tuple[float, float]:
    """Path accelerations that keep the efforts within their limits at squared speed x; empty: low > high."""
    with np.errstate(divide="ignore", invalid="ignore"):
        one, two = (low - b * x) / a, (high - b * x) / a
    flat = np.abs(a) < 1e-14 * max(float(np.abs(a).max()), 1e-300)
    if (flat & ((b * x < low) | (b * x > high))).any():
        return 1.0, -1.0
    least = np.where(flat, -np.inf, np.minimum(one, two)).max()
    most = np.where(flat, np.inf, np.maximum(one, two)).min()
    return float(least), float(most)


def _largest(top: float, fits: Callable[[float], bool]) -> float:
    """Largest x in [0, top] that fits, the set being an interval that starts at 0."""
    if fits(top):
        return top
    inside, outside = 0.0, top
    for _ in range(BISECTIONS):
        middle = (inside + outside) / 2
        inside, outside = (middle, outside) if fits(middle) else (inside, middle)
    return inside


def _passes(step: Floats, a: Floats, b: Floats, low: Floats, high: Floats, top: Floats) -> Floats:
    n = len(top)
    controllable = np.zeros(n)
    for i in range(n - 2, -1, -1):
        ahead = controllable[i + 1]

        def fits(x: float, i: int = i, ahead: float = ahead) -> bool:
            least, most = _range(x, a[i], b[i], low[i], high[i])
            return least <= most and x + 2 * step[i] * least <= ahead and x + 2 * step[i] * most >= 0

        controllable[i] = _largest(float(top[i]), fits)
    x = np.zeros(n)
    for i in range(n - 1):
        _, most = _range(x[i], a[i], b[i], low[i], high[i])
        x[i + 1] = min(max(x[i] + 2 * step[i] * most, 0.0), controllable[i + 1])
    return x
