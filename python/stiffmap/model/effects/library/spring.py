"""What the effects that insert an isotropic spring share."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from stiffmap.model.description import MachineDescription, Offset, Pose, Spring
from stiffmap.model.description.strokes import Matrix6, as_rows
from stiffmap.model.effects.edit import fresh
from stiffmap.model.effects.library.geometry import point, translation_of
from stiffmap.model.effects.sites import at
from stiffmap.model.effects.types import Parameter, Placed

PARAMETERS = (
    Parameter("translation", "m/N", 0.0, 1e-3, 0.0, 1e-9, "compliance of each translation"),
    Parameter("rotation", "rad/(N·m)", 0.0, 1.0, 0.0, 1e-7, "compliance of each rotation"),
)


def isotropic(placed: Placed) -> Matrix6:
    """6x6 compliance, diagonal; rigid at zero."""
    diagonal = [placed.values["translation"]] * 3 + [placed.values["rotation"]] * 3
    return as_rows(np.diag(diagonal))


def spring_at(end: str) -> dict[str, Any]:
    """What effects share that put an isotropic spring at a pivot, before all of the ``base`` or behind the ``platform``."""

    def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
        elements, pivot = getattr(description, end), translation_of(placed.values, "pivot_")
        name = fresh(placed.kind, elements)
        there, back = (Offset(f"{name}_{way}", Pose.of(p)) for way, p in (("there", pivot), ("back", -pivot)))
        new = (there, Spring(name, compliance=isotropic(placed)), back)
        changed: dict[str, Any] = {end: (*new, *elements) if end == "base" else (*elements, *new)}
        return replace(description, **changed)

    return {
        "parameters": (*PARAMETERS, *point("pivot", "where the spring sits")),
        "places": at(end),
        "apply": apply,
        "vector": ("translation", "rotation"),
        "stage": 50,
    }
