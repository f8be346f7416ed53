"""A whole leg mounted askew on the base."""

from __future__ import annotations

from stiffmap.model.description import MachineDescription, Offset, Pose
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.edit import built, edit_chains, splice
from stiffmap.model.effects.library.geometry import rotation_of, rotations
from stiffmap.model.effects.sites import per_leg
from stiffmap.model.effects.types import EffectType, Placed


def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
    """A rotation at the end of the offsets with which the leg begins."""
    turn = built("leg_tilt", Pose.of(rotation=rotation_of(placed.values)))

    def tilted(elements: Elements) -> Elements:
        i = next((i for i, e in enumerate(elements) if not isinstance(e, Offset)), 0)
        return splice(elements, i, (turn, elements[i]))

    return edit_chains(description, placed.legs, tilted)


EFFECT = EffectType(
    kind="leg_tilt",
    precedence=190,
    title="whole leg mounted askew",
    doc="The whole leg is mounted on the base turned about the origin of its frame.",
    **rotations("rotation"),
    places=per_leg("base"),
    apply=apply,
    pivot="origin of the leg's frame on the base",
    frame="axes of the leg's frame; about x, then the turned y, then the twice turned z",
    moves="the whole leg up to the platform",
    excludes=("leg_tilt",),
    stage=25,
)
