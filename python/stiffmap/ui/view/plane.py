"""The plane through the tool: where its poses lie, and what is found at them."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from contourpy import contour_generator

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.compiled import Status
from stiffmap.solve.machine import Machine
from stiffmap.ui.plot.planes import levels
from stiffmap.ui.plot.scene import box_corners
from stiffmap.ui.view.place import drawn_box, orientation, solved
from stiffmap.ui.view.quantities import QUANTITIES, Mask, tolerance_level
from stiffmap.ui.view.state import ViewState
from stiffmap.workspace.performance.motion.inertia import NaturalFrequencies, natural_frequencies
from stiffmap.workspace.vibration import frequency_response

FINE, COARSE, DEAR = 101, 51, 15
"""Poses along each edge: at rest, while something is dragged, and of quantities that need modes."""
NO_LINES = np.zeros((0, 2, 3))
MODES = 40
"""As parallel machines have dozens of modes of their bars below those that move the tool."""
DAMPING = 0.02
"""Modal damping ratio of every mode."""
INSIDE = 1e-9
"""Of the box, how far outside it a pose may lie by round-off."""


@dataclass(frozen=True)
class Frame:
    """A rectangle in the plane: its centre, its two edges (unit vectors) and their lengths, m."""

    centre: Floats
    u: Floats
    v: Floats
    width: float
    height: float

    @property
    def normal(self) -> Floats:
        """(3,) unit vector."""
        return np.asarray(np.cross(self.u, self.v))

    def nodes(self, count: int) -> tuple[Floats, Floats]:
        """(count,) along u and along v from the centre, m."""
        part = np.linspace(-0.5, 0.5, count)
        return part * self.width, part * self.height

    def poses(self, count: int) -> Floats:
        """(count, count, 3) m, rows along v."""
        a, b = self.nodes(count)
        return np.asarray(self.centre + b[:, None, None] * self.v + a[None, :, None] * self.u)

    def under_ray(self, origin: Floats, direction: Floats) -> Floats | None:
        """(3,) where a ray (m) meets the rectangle; None where it misses."""
        across = float(np.dot(direction, self.normal))
        if abs(across) < 1e-9:
            return None
        t = float(np.dot(self.centre - origin, self.normal)) / across
        point = np.asarray(origin) + t * np.asarray(direction)
        off = point - self.centre
        inside = abs(off @ self.u) <= self.width / 2 and abs(off @ self.v) <= self.height / 2
        return point if t > 0 and inside else None


def plane_frame(machine: Machine, state: ViewState) -> Frame:
    """The rectangle across the workspace box that holds the tool."""
    low, high = drawn_box(machine)
    p = np.array(state.position)
    if state.plane == "free":
        n = np.array(state.normal) / np.linalg.norm(state.normal)
        other = np.eye(3)[int(np.argmin(np.abs(n)))]
        u = np.cross(other, n)
        u /= np.linalg.norm(u)
        v = np.cross(n, u)
        corners = box_corners(low, high) - p
        along = np.stack([corners @ u, corners @ v])
        lowest, highest = along.min(axis=1), along.max(axis=1)
        middle = (lowest + highest) / 2
        width, height = highest - lowest
        return Frame(p + middle[0] * u + middle[1] * v, u, v, float(width), float(height))
    axis = "xyz".index(state.plane)
    right, up = (i for i in range(3) if i != axis)
    centre = (low + high) / 2
    centre[axis] = p[axis]
    e = np.eye(3)
    return Frame(centre, e[right], e[up], float(high[right] - low[right]), float(high[up] - low[up]))


@dataclass(frozen=True, eq=False)
class PlaneMap:
    """Values in a plane, SI; NaN where there is none, and why in `status`."""

    frame: Frame
    quantity: str
    values: Floats
    """(count, count), rows along v."""
    status: Floats
    """(count, count) of `Status`."""
    outside: Mask
    """(count, count), outside the workspace box."""
    seconds: float
    """Time of the solution."""

    @property
    def count(self) -> int:
        """Poses along an edge."""
        return len(self.values)

    @cached_property
    def shown(self) -> Floats:
        """Values in the unit of the screen."""
        return np.asarray(self.values * QUANTITIES[self.quantity].factor)

    @property
    def failed(self) -> Mask:
        """(count, count), inside the box and without an equilibrium."""
        return np.asarray((self.status != Status.CONVERGED) & ~self.outside)

    @property
    def range(self) -> tuple[float, float]:
        """Lowest and highest value in the unit of the screen; (0, 1) where there is none."""
        good = self.shown[np.isfinite(self.shown)]
        if not good.size:
            return 0.0, 1.0
        low, high = float(good.min()), float(good.max())
        if high - low <= 1e-9 * max(abs(high), abs(low)):
            return low - max(1e-3 * abs(low), 1e-12), high + max(1e-3 * abs(high), 1e-12)
        return low, high

    def lines_at(self, level: float) -> Floats:
        """(n, 2, 3) m, pieces of the line on which the value (unit of the screen) is `level`."""
        if self.count < 2 or not np.isfinite(self.shown).any():
            return NO_LINES
        pieces = contour_generator(*self.frame.nodes(self.count), np.ma.masked_invalid(self.shown)).lines(
            level
        )
        lines = [np.asarray(line) for line in pieces]
        ends = [np.stack([line[:-1], line[1:]], axis=1) for line in lines if len(line) > 1]
        if not ends:
            return NO_LINES
        flat, f = np.concatenate(ends), self.frame
        return np.asarray(f.centre + flat[..., :1] * f.u + flat[..., 1:] * f.v)

    def isolines(self, limits: tuple[float, float]) -> Floats:
        """(n, 2, 3) of all round levels; none of a status."""
        if self.quantity == "status":
            return NO_LINES
        return np.concatenate([NO_LINES, *map(self.lines_at, levels(*limits))])

    def tolerance_lines(self, tolerance: float) -> Floats:
        """(n, 2, 3) of the line at which the tolerance (m) is met."""
        level = tolerance_level(self.quantity, tolerance)
        return NO_LINES if level is None else self.lines_at(level)


def values_at(machine: Machine, state: ViewState, position: Floats) -> tuple[Floats, Floats]:
    """(...) of the state's quantity with the tool at (..., 3) m, SI, and statuses."""
    quantity = QUANTITIES[state.quantity]
    if quantity.of is None:
        make = lowest_frequency if state.quantity == "frequency" else dynamic_stiffness
        return make(machine, state, position)
    s = solved(machine, state, position, stiffness=quantity.stiffness)
    size = float(np.linalg.norm(state.force))
    return quantity.of(s, size, state.tolerance), np.asarray(s.status, dtype=float)


def plane_map(machine: Machine, state: ViewState, count: int = FINE) -> PlaneMap:
    """Solve the poses of the plane; outside the box they are solved as well and hidden."""
    begun = time.perf_counter()
    frame = plane_frame(machine, state)
    if QUANTITIES[state.quantity].of is None:
        count = min(count, DEAR)
    p = frame.poses(count)
    low, high = drawn_box(machine)
    slack = INSIDE * (high - low)
    outside = np.asarray(((p < low - slack) | (p > high + slack)).any(axis=-1))
    values, status = values_at(machine, state, p)
    values = np.where(outside, np.nan, values)
    return PlaneMap(frame, state.quantity, values, status, outside, time.perf_counter() - begun)


def modes_at(
    machine: Machine, state: ViewState, position: Floats, modes: int, threads: int | None = None
) -> NaturalFrequencies:
    """The lowest modes at (..., 3) m under the load of a state; StiffmapError where bodies lack masses."""
    return natural_frequencies(
        machine, position, state.wrench, rotation=orientation(state), gravity=state.gravity, modes=modes,
        threads=threads,
    )  # fmt: skip


def lowest_frequency(machine: Machine, state: ViewState, position: Floats) -> tuple[Floats, Floats]:
    """(...) Hz and statuses."""
    w = modes_at(machine, state, position, 1)
    return np.asarray(w.frequency[..., 0]), np.asarray(w.status, dtype=float)


def dynamic_stiffness(machine: Machine, state: ViewState, position: Floats) -> tuple[Floats, Floats]:
    """(...) N/m of the softest direction at the state's frequency, and statuses; modes beyond the lowest count as statics."""
    found = frequency_response(
        machine, position, [state.frequency], state.wrench, rotation=orientation(state), gravity=state.gravity,
        damping=DAMPING, modes=MODES, symmetrise=True,
    )  # fmt: skip
    c = found.values[..., 0, :3, :3]
    good = np.isfinite(c).all(axis=(-2, -1))
    softest = np.linalg.norm(np.where(good[..., None, None], c, np.eye(3)), 2, axis=(-2, -1))
    return np.where(good, 1.0 / softest, np.nan), np.asarray(found.status, dtype=float)
