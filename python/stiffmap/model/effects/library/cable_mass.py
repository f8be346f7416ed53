"""Weight of the cables themselves."""

from __future__ import annotations

import numpy as np

from stiffmap.model.description import Body, Cable, Element, MachineDescription
from stiffmap.model.effects.edit import edit_legs, fresh
from stiffmap.model.effects.sites import at_sites, cables
from stiffmap.model.effects.types import EffectType, Parameter, Placed


def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
    """Half of the length at home hangs at the fixing point."""
    home = description.home

    def edit(elements: tuple[Element, ...]) -> tuple[Element, ...]:
        out = elements
        for i in reversed(cables(elements).get(placed.element, ())):
            e = elements[i]
            assert isinstance(e, Cable)
            length = float(np.linalg.norm(home.p + home.r @ np.array(e.at) - np.array(e.anchor)))
            body = Body(fresh(f"{e.name}_weight", out), 0.5 * placed.values["density"] * length, e.at)
            out = (*out[: i + 1], body, *out[i + 1 :])
        return out

    return edit_legs(description, placed.legs, edit)


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
