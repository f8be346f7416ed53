"""A link mounted under tension."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.model.description import Element, MachineDescription, Spring
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.edit import change_sites
from stiffmap.model.effects.library.geometry import names_of, translation_of, translations
from stiffmap.model.effects.sites import at_sites, springs
from stiffmap.model.effects.types import EffectType, Parameter, Placed

PARAMETERS: tuple[Parameter, ...] = translations("force-free deflection", "rest_")


def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
    """Moves the deflection at which the spring is free of force."""
    x, y, z = translation_of(placed, "rest_")

    def change(e: Element) -> Elements:
        assert isinstance(e, Spring)
        a, b, c, *rotations = e.rest
        return (replace(e, rest=(a + x, b + y, c + z, *rotations)),)

    return change_sites(description, placed.legs, placed.element, springs, change)


EFFECT = EffectType(
    kind="preload",
    precedence=280,
    title="link mounted under tension",
    doc=(
        "The link is free of force not at zero deflection but at `rest`: mounted, it pulls the machine. In a "
        "parallelogram both bars alike."
    ),
    parameters=PARAMETERS,
    places=at_sites(springs),
    apply=apply,
    frame="local axes of the spring",
    moves="all behind the link",
    vector=names_of(PARAMETERS),
)
