"""Dry friction of a passive joint."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.model.description import JointFriction, MachineDescription
from stiffmap.model.effects.edit import change_sites
from stiffmap.model.effects.library import friction
from stiffmap.model.effects.sites import at_sites, free_joints
from stiffmap.model.effects.types import EffectType, Placed


def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
    """Friction on each joint of the place; none at the level 0."""
    level = friction.level_of(description, placed)
    new = JointFriction(level, placed.options["branch"]) if level > 0.0 else None
    place = (placed.legs, placed.element, free_joints)
    return change_sites(description, *place, lambda e: (replace(e, friction=new),))


EFFECT = EffectType(
    kind="joint_friction",
    precedence=250,
    title="dry friction of a passive joint",
    doc=(
        "Coulomb friction about each axis of a free passive joint, level L, against its motion q from the commanded "
        "configuration: on the branch `loading` (from zero load) the joint resists with L against the motion that it "
        "makes without friction; on `unloading` (from a larger load, friction fully reversed) L acts with it; "
        "`loading_stuck` holds the joint at q = 0 until L is reached and resists with L beyond. Where a joint slips, "
        "`loading` and `loading_stuck` agree; where it would not, `loading` pushes it back too far."
    ),
    **friction.dry(
        "Coulomb level of a sliding joint",
        "Coulomb level about each axis of a joint that turns",
        "loading_stuck",
        "loading",
        "unloading",
    ),
    places=at_sites(free_joints),
    apply=apply,
    frame="the joint's axes",
    excludes=("joint_friction",),
)
