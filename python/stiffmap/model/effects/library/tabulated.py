"""A measured force-deflection curve."""

from __future__ import annotations

from itertools import pairwise

from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import Law
from stiffmap.model.effects.library.drive_law import linear, on_law
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
    **on_law(law, tried=lambda description: []),
    vector=tuple(p.name for p in FACTORS),
    excludes=(
        "tabulated",
        "dead_zone",
        "hardening",
        "bilinear",
        "friction",
        "position_dependent_compliance",
    ),
)
