"""Backlash of a drive."""

from __future__ import annotations

from stiffmap.model.description import Law
from stiffmap.model.effects.library.drive_law import linear, on_law
from stiffmap.model.effects.types import EffectType, Parameter, Placed

HALF_WIDTH = Parameter(
    "half_width",
    "m",
    0.0,
    0.01,
    0.0,
    1e-5,
    "deflection without force to each side of the centre",
    angular="rad",
    angular_upper=0.5,
    angular_scale=1e-4,
)


def law(old: Law, placed: Placed) -> Law:
    """A polyline law with a piece of zero force; plain at zero width."""
    half = placed.values["half_width"]
    return Law(linear(old).stiffness, knots=((-half, 0.0), (half, 0.0))) if half > 0.0 else linear(old)


EFFECT = EffectType(
    kind="dead_zone",
    precedence=20,
    reverses=True,
    title="backlash of a drive, gap in a joint or a spring's direction",
    doc=(
        "A gap in series with the spring of a drive, an elastic joint or an uncoupled direction of a link spring (element `foot.k22`): no force while the deflection is within the half width "
        "about the centre, the declared stiffness beyond. Unloaded, it stands in the centre."
    ),
    parameters=(HALF_WIDTH,),
    **on_law(law),
    excludes=("dead_zone", "hardening", "tabulated"),
)
