"""A drive or spring that stiffens with load."""

from __future__ import annotations

from stiffmap.model.description import Law
from stiffmap.model.effects.library.drive_law import changing_law, in_unit_of_joint, linear
from stiffmap.model.effects.sites import at_sites, elastic_directions, elastic_drives
from stiffmap.model.effects.types import EffectType, Parameter, Placed

CUBIC = Parameter(
    "cubic",
    "N/m^3",
    0.0,
    1e20,
    0.0,
    1e14,
    "coefficient of the deflection's third power",
    angular="N·m/rad^3",
    angular_scale=1e9,
)


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
    parameters=(CUBIC,),
    places=at_sites(elastic_directions),
    apply=changing_law(law),
    tried=at_sites(elastic_drives),
    frame="the coordinate",
    excludes=("hardening", "dead_zone", "friction", "position_dependent_compliance", "tabulated"),
    stage=10,
    at=in_unit_of_joint(CUBIC),
)
