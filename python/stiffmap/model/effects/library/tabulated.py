"""A measured force-deflection curve."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import Law, MachineDescription
from stiffmap.model.effects.library.drive_law import changing_law, is_revolute, linear
from stiffmap.model.effects.sites import at_sites, elastic_directions
from stiffmap.model.effects.types import EffectType, Parameter, Placed

POINTS = 4
STEP = Parameter(
    "step", "m", 1e-9, 1.0, None, 1e-5, "deflection between the points", fitted=False, angular="rad"
)
FACTORS = tuple(
    Parameter(f"factor_{i}", "1", 1e-3, 1e3, 1.0, 0.1, f"force over the declared one at {i} steps")
    for i in range(1, POINTS + 1)
)


def law(old: Law, placed: Placed) -> Law:
    """An odd polyline through the points, its last piece going on; plain where all factors are 1."""
    step, factors = placed.values["step"], [placed.values[p.name] for p in FACTORS]
    if all(f == 1.0 for f in factors):
        return linear(old)
    points = [(i * step, f * linear(old).stiffness * i * step) for i, f in enumerate(factors, 1)]
    (a0, f0), (a1, f1) = points[-2:]
    if any(f <= before for (_, before), (_, f) in pairwise(points)):
        raise StiffmapError("the force must rise from point to point: factor_i times i")
    mirrored = [(-a, -f) for a, f in reversed(points)]
    return Law((f1 - f0) / (a1 - a0), knots=(*mirrored, *points))


def at(description: MachineDescription, element: str, legs: tuple[str, ...]) -> tuple[Parameter, ...]:
    """Steps in rad where it turns."""
    turns = is_revolute(description, element)
    return (replace(STEP, unit=STEP.angular) if turns else STEP, *FACTORS)


EFFECT = EffectType(
    kind="tabulated",
    precedence=50,
    title="spring with a measured force-deflection curve",
    doc=(
        "Force of a drive, an elastic joint or an uncoupled direction of a link spring (element `foot.k22`) by a "
        "table: at 1, 2, 3, 4 steps of deflection it is `factor_i` times the declared one, straight between the "
        "points and through zero, the same in both directions; the last piece goes on beyond. The force must rise."
    ),
    parameters=(STEP, *FACTORS),
    places=at_sites(elastic_directions),
    apply=changing_law(law),
    frame="the coordinate",
    vector=tuple(p.name for p in FACTORS),
    excludes=(
        "tabulated",
        "dead_zone",
        "hardening",
        "bilinear",
        "friction",
        "position_dependent_compliance",
    ),
    stage=10,
    at=at,
    tried=lambda description: [],
)
