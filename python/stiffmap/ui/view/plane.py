"""A plane of poses, and what was found at them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from contourpy import contour_generator

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.compiled import Status
from stiffmap.ui.plot.planes import levels
from stiffmap.ui.view.quantities import QUANTITIES, Mask, tolerance_level

NO_LINES = np.zeros((0, 2, 3))


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
