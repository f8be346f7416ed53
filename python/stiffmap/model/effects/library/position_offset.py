"""Position of a guide, a joint, a base point or a joint point of the platform."""

from __future__ import annotations

from stiffmap.model.description import Joint, MachineDescription, Pose
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.edit import built, change_sites, edit_chains, splice
from stiffmap.model.effects.library.geometry import translation_of, translations
from stiffmap.model.effects.sites import at_sites, joints, per_leg
from stiffmap.model.effects.types import EffectType, Place, Placed


def find(description: MachineDescription) -> list[Place]:
    """Joints, and the two ends of each leg."""
    return at_sites(joints)(description) + per_leg("base")(description) + per_leg("platform")(description)


def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
    """An offset before the joint, at the leg's beginning, or (reversed) at its end."""
    error, name = translation_of(placed.values), f"{placed.element}_position_offset"
    if placed.element == "base":
        first = built(name, Pose.of(error))
        return edit_chains(description, placed.legs, lambda seq: splice(seq, 0, (first, seq[0])))
    if placed.element == "platform":
        last = built(name, Pose.of(-error))  # a point moved by +e puts the platform -e behind it
        return edit_chains(description, placed.legs, lambda seq: splice(seq, len(seq) - 1, (seq[-1], last)))

    def change(e: Joint) -> Elements:
        return (built(f"{e.name}_position_offset", Pose.of(error)), e)

    return change_sites(description, placed.legs, placed.element, joints, change)


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
    **translations("displacement"),
    places=find,
    apply=apply,
    frame="axes of the frame before the joint at its zero; base axes; platform axes",
    moves="the joint and all that it carries, up to the platform; nothing turns",
    stage=30,
)
