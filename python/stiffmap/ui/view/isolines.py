"""Lines of equal value in the plane, in space."""

from __future__ import annotations

import numpy as np
from contourpy import contour_generator

from stiffmap.common.broadcasting import Floats
from stiffmap.ui.plot.isolines import levels
from stiffmap.ui.view.plane import PlaneMap
from stiffmap.ui.view.quantities import QUANTITIES


def lines_at(found: PlaneMap, level: float) -> Floats:
    """(n, 2, 3) m, pieces of the line on which the value (unit of the screen) is `level`."""
    f, n = found.frame, found.count
    if n < 2 or not np.isfinite(found.shown).any():
        return np.zeros((0, 2, 3))
    a, b = (np.linspace(-0.5, 0.5, n) * size for size in (f.width, f.height))
    masked = np.ma.masked_invalid(found.shown)
    pieces = contour_generator(a, b, masked).lines(level)
    lines = [np.asarray(line) for line in pieces]
    ends = [np.stack([line[:-1], line[1:]], axis=1) for line in lines if len(line) > 1]
    if not ends:
        return np.zeros((0, 2, 3))
    flat = np.concatenate(ends)
    return np.asarray(f.centre + flat[..., :1] * f.u + flat[..., 1:] * f.v)


def isolines(found: PlaneMap, limits: tuple[float, float]) -> Floats:
    """(n, 2, 3) of all round levels; none of a status."""
    if found.quantity == "status":
        return np.zeros((0, 2, 3))
    parts = [lines_at(found, t) for t in levels(*limits)]
    return np.concatenate(parts) if parts else np.zeros((0, 2, 3))


def tolerance_level(quantity: str, tolerance: float) -> float | None:
    """The value on the screen at which the tolerance is met; None where it has no meaning."""
    if quantity in ("deflection", "worst"):
        return tolerance * QUANTITIES[quantity].factor
    return 0.0 if quantity == "margin" else None


def tolerance_lines(found: PlaneMap, tolerance: float) -> Floats:
    """(n, 2, 3) of the line at which the tolerance is met."""
    level = tolerance_level(found.quantity, tolerance)
    return np.zeros((0, 2, 3)) if level is None else lines_at(found, level)
