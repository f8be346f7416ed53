"""What the effects that insert an isotropic spring share."""

from __future__ import annotations

import numpy as np

from stiffmap.model.description import Element, Offset, Pose, Spring
from stiffmap.model.effects.types import Parameter, Placed

PARAMETERS = (
    Parameter("translation", "m/N", 0.0, 1e-3, 0.0, 1e-9, "compliance of each translation"),
    Parameter("rotation", "rad/(N·m)", 0.0, 1.0, 0.0, 1e-7, "compliance of each rotation"),
)

PIVOT = tuple(
    Parameter(
        f"pivot_{a}", "m", -100.0, 100.0, None, 0.1, f"where the spring sits, {a}", default=0.0, fitted=False
    )
    for a in "xyz"
)


def isotropic(placed: Placed) -> tuple[tuple[float, ...], ...]:
    """6x6 compliance, diagonal; rigid at zero."""
    diagonal = [placed.values["translation"]] * 3 + [placed.values["rotation"]] * 3
    return tuple(tuple(diagonal[i] if i == j else 0.0 for j in range(6)) for i in range(6))


def spring_about(name: str, placed: Placed) -> tuple[Element, ...]:
    """The isotropic spring at the pivot, seen from the frame where it is inserted."""
    pivot = np.array([placed.values[f"pivot_{a}"] for a in "xyz"])
    there, back = Pose.of(pivot), Pose.of(-pivot)
    spring = Spring(name, compliance=isotropic(placed))
    return (Offset(f"{name}_there", there), spring, Offset(f"{name}_back", back))
