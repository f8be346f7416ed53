"""Friction of the pulley or eye over which a cable runs."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.model.description import Cable
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.sites import each, led_cables
from stiffmap.model.effects.types import EffectType, Parameter, Placed


def rubbing(e: Cable, placed: Placed) -> Elements:
    """The lead between winch and guide has another tension than the free length, and stretches as it asks."""
    return (replace(e, lead_tension=e.lead_tension * (1.0 - placed.values["share"])),)


EFFECT = EffectType(
    kind="guide_friction",
    precedence=75,
    title="friction of a cable's guide",
    doc=(
        "The guide takes `share` of the free length's tension while that grows: the lead between winch and guide "
        "carries, and stretches by, so much less. Negative: while it falls. e^(mu angle) of a rope over a drum that "
        "stands still is a share of 1 - e^(-mu angle)."
    ),
    parameters=(Parameter("share", "1", -1.0, 1.0, 0.0, 0.05, "of the tension", plausible=(-0.3, 0.3)),),
    **each(led_cables, rubbing),
    moves="nothing",
)
