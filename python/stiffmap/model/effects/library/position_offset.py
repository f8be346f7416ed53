"""Position of a guide, a joint, a base point or a joint point of the platform."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.model.description import Element, MachineDescription, Pose
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.edit import built, change_sites, splice
from stiffmap.model.effects.library.geometry import names_of, translation_of, translations
from stiffmap.model.effects.sites import joints, per_leg, places
from stiffmap.model.effects.types import EffectType, Parameter, Place, Placed

PARAMETERS: tuple[Parameter, ...] = translations("displacement")


def find(description: MachineDescription) -> list[Place]:
    """Joints, and the two ends of each leg."""
    return places(description, joints) + per_leg("base")(description) + per_leg("platform")(description)


def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
    """An offset before the joint, at the leg's beginning, or (reversed) at its end."""
    error = translation_of(placed)
    if placed.element in ("base", "platform"):
        return _at_end(description, placed)

    def change(e: Element) -> Elements:
        return (built(f"{e.name}_position_offset", Pose.of(error)), e)

    return change_sites(description, placed.legs, placed.element, joints, change)


def _at_end(description: MachineDescription, placed: Placed) -> MachineDescription:
    error = translation_of(placed)
    near = placed.element == "base"
    # a joint point of the platform moved by +e puts the platform -e behind it
    offset = built(f"{placed.element}_position_offset", Pose.of(error if near else -error))
    legs = tuple(
        replace(leg, elements=add_end(leg.elements, offset, near)) if leg.name in placed.legs else leg
        for leg in description.legs
    )
    return replace(description, legs=legs)


def add_end(elements: Elements, new: Element, near: bool) -> Elements:
    """``new`` as the first or the last element, under a free name."""
    if near:
        return splice(elements, 0, (new, elements[0]))
    return splice(elements, len(elements) - 1, (elements[-1], new))


EFFECT = EffectType(
    kind="position_offset",
    precedence=160,
    title="line of a guide or joint axis; base and platform joint points",
    doc=(
        "A joint (guide) stands displaced on the part that carries it. On `base` the leg's beginning stands "
        "displaced in base axes; on `platform` the point where the leg holds the platform is displaced in "
        "platform axes. Along a prismatic drive it is its zero offset; with `tilt` it is the line of the "
        "axis."
    ),
    parameters=PARAMETERS,
    places=find,
    apply=apply,
    frame="axes of the frame before the joint at its zero; base axes; platform axes",
    moves="the joint and all that it carries, up to the platform; nothing turns",
    vector=names_of(PARAMETERS),
    stage=30,
)
