"""What the effects that insert an isotropic spring share."""

from __future__ import annotations

import numpy as np

from stiffmap.model.description import Element, Offset, Pose, Spring
from stiffmap.model.description.strokes import Matrix6, as_rows
from stiffmap.model.effects.library.geometry import point, translation_of
from stiffmap.model.effects.types import Parameter, Placed

PARAMETERS = (
    Parameter("translation", "m/N", 0.0, 1e-3, 0.0, 1e-9, "compliance of each translation"),
    Parameter("rotation", "rad/(N·m)", 0.0, 1.0, 0.0, 1e-7, "compliance of each rotation"),
)

PIVOT = point("pivot", "where the spring sits")


def isotropic(placed: Placed) -> Matrix6:
    """6x6 compliance, diagonal; rigid at zero."""
    diagonal = [placed.values["translation"]] * 3 + [placed.values["rotation"]] * 3
    return as_rows(np.diag(diagonal))


def spring_about(name: str, placed: Placed) -> tuple[Element, ...]:
    """The isotropic spring at the pivot, seen from the frame where it is inserted."""
    pivot = translation_of(placed, "pivot_")
    there, back = Pose.of(pivot), Pose.of(-pivot)
    spring = Spring(name, compliance=isotropic(placed))
    return (Offset(f"{name}_there", there), spring, Offset(f"{name}_back", back))
