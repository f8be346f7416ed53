"""Links that grow with temperature."""

from __future__ import annotations

from stiffmap.model.description import Element
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.library.length import longer
from stiffmap.model.effects.sites import each, lengths
from stiffmap.model.effects.types import EffectType, Parameter, Placed

PARAMETERS = (
    Parameter(
        "coefficient",
        "1/K",
        -1e-3,
        1e-3,
        0.0,
        1e-5,
        "growth per length and kelvin",
        plausible=(-5e-5, 5e-5),  # metals, ceramics and composites
    ),
    Parameter(
        "temperature_difference",
        "K",
        -200.0,
        200.0,
        None,
        1.0,
        "temperature above that of the declared length; left out, the coefficient is the strain",
        default=1.0,
        fitted=False,
        recorded="temperature",
    ),
)


def grown(e: Element, placed: Placed) -> Elements:
    """Longer by the share of its length that all links grow."""
    strain = placed.values["coefficient"] * placed.values["temperature_difference"]
    return (longer(e, strain=strain),)


EFFECT = EffectType(
    kind="thermal_growth",
    precedence=150,
    title="thermal growth of a link",
    doc="The link is longer by coefficient·temperature_difference times its declared length.",
    parameters=PARAMETERS,
    **each(lengths, grown),
    pivot="the link's near end",
    frame="direction of the link",
    moves="all behind the link; nothing turns",
    needs=("temperature",),
)
