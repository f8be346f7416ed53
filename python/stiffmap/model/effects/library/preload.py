"""A link mounted under tension."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.model.description import Spring
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.library.geometry import translation_of, translations
from stiffmap.model.effects.sites import each, springs
from stiffmap.model.effects.types import EffectType, Placed


def pulled(e: Spring, placed: Placed) -> Elements:
    """Moves the deflection at which the spring is free of force."""
    x, y, z = translation_of(placed.values, "rest_")
    a, b, c, *rotations = e.rest
    return (replace(e, rest=(a + x, b + y, c + z, *rotations)),)


EFFECT = EffectType(
    kind="preload",
    precedence=280,
    title="link mounted under tension",
    doc=(
        "The link is free of force not at zero deflection but at `rest`: mounted, it pulls the machine. In a "
        "parallelogram both bars alike."
    ),
    **translations("force-free deflection", "rest_"),
    **each(springs, pulled),
    frame="local axes of the spring",
    moves="all behind the link",
)
