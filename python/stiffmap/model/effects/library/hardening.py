"""A drive or spring that stiffens with load."""

from __future__ import annotations

from stiffmap.model.description import Law
from stiffmap.model.effects.library.drive_law import linear, on_law
from stiffmap.model.effects.types import EffectType, Parameter, Placed


def law(old: Law, placed: Placed) -> Law:
    """force = a/c + cubic a^3."""
    return Law(linear(old).stiffness, cubic=placed.values["cubic"])


EFFECT = EffectType(
    kind="hardening",
    precedence=30,
    title="spring that stiffens with load",
    doc=(
        "Force = a/c + cubic·a³ at the deflection a, with the nominal compliance c, of a drive, an elastic joint or "
        "an uncoupled direction of a link spring (element `foot.k22`)."
    ),
    parameters=(
        Parameter(
            "cubic",
            "N/m^3",
            0.0,
            1e20,
            0.0,
            1e14,
            "coefficient of the deflection's third power",
            angular="N·m/rad^3",
            angular_scale=1e9,
        ),
    ),
    **on_law(law),
    excludes=("hardening", "dead_zone", "friction", "position_dependent_compliance", "tabulated"),
)
