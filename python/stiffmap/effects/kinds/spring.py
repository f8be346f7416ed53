"""What the effects that insert an isotropic spring share."""

from __future__ import annotations

from stiffmap.effects.types import Parameter, Placed

PARAMETERS = (
    Parameter("translation", "m/N", 0.0, 1e-3, 0.0, 1e-9, "compliance of each translation"),
    Parameter("rotation", "rad/(N·m)", 0.0, 1.0, 0.0, 1e-7, "compliance of each rotation"),
)


def isotropic(placed: Placed) -> tuple[tuple[float, ...], ...]:
    """6x6 compliance, diagonal; rigid at zero."""
    diagonal = [placed.values["translation"]] * 3 + [placed.values["rotation"]] * 3
    return tuple(tuple(diagonal[i] if i == j else 0.0 for j in range(6)) for i in range(6))
