"""Time-optimal speed along a given path: backward and forward passes over the squared path speed.

The method is reachability analysis (Pham and Pham, IEEE Transactions on Robotics 34, 2018): at each
sample the drives' limits are half-planes in (path acceleration u, squared path speed x).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats, real_array
from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import place_text
from stiffmap.solve.machine import Machine
from stiffmap.workspace.performance.motion.closing import drive_kinematics, refuse_failed
from stiffmap.workspace.performance.motion.inertia import friction_efforts, need_masses, rigid_dynamics
from stiffmap.workspace.performance.motion.scaling import drive_values
from stiffmap.workspace.performance.motion.tensions import PUSHES, held, in_cables, inertia_columns
from stiffmap.workspace.performance.motion.trajectory import Path, Trajectory, run_along

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
    least, most = (
        friction_efforts(machine, np.sign(rate) * 1e-12),
        friction_efforts(machine, np.sign(rate) * speeds),
    )
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
    if ((low > 0) | (high < 0)).any():
        i = int(np.argmax(((low > 0) | (high < 0)).any(axis=1)))
        raise StiffmapError(
            f"{machine.name}: its drives cannot hold the load at {place_text(path.position[i], '.1f')} of the path"
        )
    x = _passes(np.diff(path.s), a, b, low, high, np.minimum(top, FASTEST))
    return _run(path, x)


def _terms(
    machine: Machine,
    coordinates: Floats,
    path: Path,
    gravity: ArrayLike | None,
    force: Floats,
    threads: int | None,
) -> tuple[Floats, Floats, Floats, Floats]:
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


def _run(path: Path, x: Floats) -> Trajectory:
    """Times, velocities and accelerations of the squared speeds x."""
    step = np.diff(path.s)
    root = np.sqrt(x)
    spans = 2 * step / (root[1:] + root[:-1])
    if not np.isfinite(spans).all():
        i = int(np.argmax(~np.isfinite(spans)))
        raise StiffmapError(
            f"the drives cannot move the tool along the path at {place_text(path.position[i], '.1f')}"
        )
    u = np.append(np.diff(x) / (2 * step), 0.0)
    return run_along(path, np.concatenate([[0.0], np.cumsum(spans)]), root, x, u)
