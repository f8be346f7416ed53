"""Weight of the cables themselves."""

from __future__ import annotations

import numpy as np

from stiffmap.model.description import Body, Cable, MachineDescription
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.edit import change_sites
from stiffmap.model.effects.sites import at_sites, cables
from stiffmap.model.effects.types import EffectType, Parameter, Placed


def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
    """Half of the length at home hangs at the fixing point."""
    home = description.home

    def hung(e: Cable) -> Elements:
        length = float(np.linalg.norm(home.p + home.r @ np.array(e.at) - np.array(e.anchor)))
        return (e, Body(f"{e.name}_weight", 0.5 * placed.values["density"] * length, e.at))

    return change_sites(description, placed.legs, placed.element, cables, hung)


EFFECT = EffectType(
    kind="cable_mass",
    precedence=305,
    title="mass of a cable",
    doc=(
        "The cable weighs `density` per length: half of its length at home hangs at its fixing point, the other half "
        "at its anchor. It stays straight (its sag is left out), and weighs where the machine has gravity."
    ),
    parameters=(Parameter("density", "kg/m", 0.0, 1e3, 0.0, 0.05, "mass per length"),),
    places=at_sites(cables),
    apply=apply,
    moves="with the platform",
    stage=70,
)
