"""Elasticity of a cable."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.model.description import Cable
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.sites import cables, each
from stiffmap.model.effects.types import EffectType, Parameter, Placed


def stretched(e: Cable, placed: Placed) -> Elements:
    """The real cable yields that many times as much as the one that lengths are commanded for."""
    return (replace(e, stretch=e.stretch * placed.values["scale"]),)


EFFECT = EffectType(
    kind="cable_stretch",
    precedence=35,
    title="elasticity of a cable",
    doc=(
        "The cable (with its lead and the stiffness in series) is `scale` times as compliant as declared; lengths are "
        "still commanded for the declared one, so that its pretension changes as well."
    ),
    parameters=(Parameter("scale", "1", 0.05, 50.0, 1.0, 0.1, "of the compliance", plausible=(0.3, 5.0)),),
    **each(cables, stretched),
    moves="nothing",
    compared=("soft", "stiff"),
)
