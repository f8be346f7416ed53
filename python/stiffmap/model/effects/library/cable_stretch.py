"""Elasticity of a cable."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.model.description import Cable, MachineDescription
from stiffmap.model.effects.edit import change_sites
from stiffmap.model.effects.sites import at_sites, cables
from stiffmap.model.effects.types import EffectType, Parameter, Placed


def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
    """The real cable yields that many times as much as the one that lengths are commanded for."""

    def change(e: Cable) -> Cable:
        return replace(e, stretch=e.stretch * placed.values["scale"])

    return change_sites(description, placed.legs, placed.element, cables, lambda e: (change(e),))  # type: ignore[arg-type]  # sites of cables


EFFECT = EffectType(
    kind="cable_stretch",
    precedence=35,
    title="elasticity of a cable",
    doc=(
        "The cable (with its lead and the stiffness in series) is `scale` times as compliant as declared; lengths are "
        "still commanded for the declared one, so that its pretension changes as well."
    ),
    parameters=(Parameter("scale", "1", 0.05, 50.0, 1.0, 0.1, "of the compliance", plausible=(0.3, 5.0)),),
    places=at_sites(cables),
    apply=apply,
    moves="nothing",
    compared=("soft", "stiff"),
)
