"""Tilt of a guide or joint with all that it carries."""

from __future__ import annotations

from stiffmap.model.description import Joint
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.edit import built
from stiffmap.model.effects.library.geometry import about, home_position, rotation_of, rotations
from stiffmap.model.effects.sites import each, joints
from stiffmap.model.effects.types import EffectType, Placed


def tilted(e: Joint, placed: Placed) -> Elements:
    """A rotation about the joint's home position, before the joint."""
    return (built(f"{e.name}_tilt", about(home_position(e), rotation_of(placed.values))), e)


EFFECT = EffectType(
    kind="tilt",
    precedence=170,
    title="tilt of a guide or joint with what it carries",
    doc=(
        "Guide tilt: the guide, its carriage and the joint axes that the carriage carries turn together "
        "about the carriage's home position. The same for any joint about its own frame."
    ),
    **rotations("rotation"),
    **each(joints, tilted),
    pivot="home position of the carriage; origin of a revolute joint",
    frame="local axes before the joint; about x, then the turned y, then the twice turned z",
    moves="the joint and all that it carries, up to the platform",
    excludes=("tilt",),
    stage=40,
)
