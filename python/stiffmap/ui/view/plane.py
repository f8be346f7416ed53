"""What the plane shows, one number per pose, from the answers of `Machine.solve`; a plane of poses with what was found at them; its image:
colours of values, hatching where a pose failed, nothing outside the box."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property

import matplotlib
import numpy as np
from contourpy import contour_generator
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats, Mask
from stiffmap.common.number_text import length_unit
from stiffmap.solve.compiled import Status
from stiffmap.solve.solution import Solution
from stiffmap.ui.plot.planes import levels
from stiffmap.ui.plot.style import BLUE, COLOURS, ORANGE, PURPLE, VERMILLION
from stiffmap.workspace.performance.motion.velocity import singular_values


@dataclass(frozen=True)
class ShownQuantity:
    """A name, its unit on the screen, and how it is read off a solution."""

    title: str
    unit: str
    factor: float
    """From SI to the unit."""
    of: Callable[[Solution, float, float], Floats] | None
    """Of a solution, the size of the force (N) and the tolerance (m). None: needs the modes of the machine, many times dearer than a solution."""
    stiffness: bool = False
    """Whether the compliance is needed."""

    def shown(self, largest: float) -> tuple[str, float]:
        """Unit in which values of this size (in `unit`) are written, and their factor: lengths from 1 mm on in mm."""
        if self.unit != "µm":
            return self.unit, 1.0
        unit, factor, _ = length_unit(largest / self.factor)
        return unit, factor / self.factor


def deflection(s: Solution, force: float, tolerance: float) -> Floats:
    """(...) m, of the tool against its command, under the load and gravity."""
    return np.asarray(np.linalg.norm(s.displacement[..., :3], axis=-1))


def worst_deflection(s: Solution, force: float, tolerance: float) -> Floats:
    """(...) m: a further force of this size in its worst direction, to first order at the loaded pose."""
    return np.asarray(force * singular_values(s.compliance[..., :3, :3])[..., 0])


def weakest_stiffness(s: Solution, force: float, tolerance: float) -> Floats:
    """(...) N/m of the softest direction."""
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / singular_values(s.compliance[..., :3, :3])[..., 0])


def margin(s: Solution, force: float, tolerance: float) -> Floats:
    """(...) m, of the tolerance that the deflection leaves."""
    return np.asarray(tolerance - deflection(s, force, tolerance))


QUANTITIES: dict[str, ShownQuantity] = {
    "deflection": ShownQuantity("deflection under this load", "µm", 1e6, deflection),
    "worst": ShownQuantity(
        "worst deflection by a force of this size", "µm", 1e6, worst_deflection, stiffness=True
    ),
    "stiffness": ShownQuantity(
        "stiffness of the softest direction", "N/µm", 1e-6, weakest_stiffness, stiffness=True
    ),
    "margin": ShownQuantity("margin to the tolerance", "µm", 1e6, margin),
    "status": ShownQuantity("status", "", 1.0, lambda s, *_: np.asarray(s.status, dtype=float)),
    "frequency": ShownQuantity("lowest natural frequency", "Hz", 1.0, None),
    "dynamic": ShownQuantity(
        "dynamic stiffness of the softest direction", "N/µm", 1e-6, None, stiffness=True
    ),
}
"""By the word that names it in a state."""


def tolerance_level(quantity: str, tolerance: float) -> float | None:
    """The value on the screen at which the tolerance is met; None where it has no meaning."""
    if quantity in ("deflection", "worst"):
        return tolerance * QUANTITIES[quantity].factor
    return 0.0 if quantity == "margin" else None


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
        values = contour_generator(*self.frame.nodes(self.count), np.ma.masked_invalid(self.shown))
        lines = [np.asarray(line) for line in values.lines(level)]
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


Image = NDArray[np.uint8]
HATCHED, PERIOD = 4, 8
"""Pixels per pose where there is something to hatch (else one), and from one line to the next."""
GREY, DARK = (205, 205, 205), (120, 40, 40)


def rgb(colour: str) -> tuple[int, int, int]:
    """0 to 255."""
    r, g, b = (round(255 * v) for v in to_rgb(colour))
    return r, g, b


STATUS_COLOURS = {
    Status.CONVERGED: rgb(BLUE),
    Status.UNREACHABLE: rgb("#A0A0A0"),
    Status.SINGULAR: rgb(PURPLE),
    Status.UNSTABLE: rgb(VERMILLION),
    Status.NOT_CONVERGED: rgb(ORANGE),
}


@cache
def table() -> Image:
    """(256, 3) colours from low to high."""
    return np.asarray(255 * matplotlib.colormaps[COLOURS](np.linspace(0, 1, 256))[:, :3] + 0.5, np.uint8)


def colours_of(values: NDArray[np.float64], low: float, high: float) -> Image:
    """(..., 3) of values in the unit of the range; grey where they are NaN."""
    part = (values - low) / (high - low)
    index = np.clip(np.nan_to_num(part), 0.0, 1.0) * 255 + 0.5
    out = table()[index.astype(np.uint8)]
    out[np.isnan(values)] = GREY
    return np.asarray(out)


def plane_image(found: PlaneMap, limits: tuple[float, float]) -> Image:
    """(rows, columns, 4), rows along v: one pixel per pose, or several where poses are hatched."""
    if found.quantity == "status":
        rgb = np.empty((*found.values.shape, 3), np.uint8)
        for kind in Status:
            rgb[found.status == kind] = STATUS_COLOURS.get(kind, GREY)
    else:
        rgb = colours_of(found.shown, *limits)
    alpha = np.where(found.outside, 0, 255).astype(np.uint8)
    image = np.dstack([rgb, alpha])
    failed = found.failed
    if not failed.any():
        return image
    image = image.repeat(HATCHED, axis=0).repeat(HATCHED, axis=1)
    stripes = np.indices(image.shape[:2]).sum(axis=0) % PERIOD < 2
    image[stripes & failed.repeat(HATCHED, axis=0).repeat(HATCHED, axis=1), :3] = DARK
    return image
