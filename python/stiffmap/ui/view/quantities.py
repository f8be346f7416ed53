"""What the plane shows: one number per pose, from the answers of `Machine.solve`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.common.number_text import length_unit
from stiffmap.solve.solution import Solution
from stiffmap.solve.worst_force import greatest


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
    return np.asarray(force * greatest(s.compliance[..., :3, :3]))


def weakest_stiffness(s: Solution, force: float, tolerance: float) -> Floats:
    """(...) N/m of the softest direction."""
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / greatest(s.compliance[..., :3, :3]))


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


Mask = NDArray[np.bool_]
