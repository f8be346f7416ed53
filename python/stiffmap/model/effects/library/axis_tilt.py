"""Direction of a guide or joint axis alone."""

from __future__ import annotations

from stiffmap.model.description import Joint, Pose
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.edit import built
from stiffmap.model.effects.library.geometry import about, home_position, rotation_of, rotations
from stiffmap.model.effects.sites import each, joints
from stiffmap.model.effects.types import EffectType, Placed


def tilted(e: Joint, placed: Placed) -> Elements:
    """The rotation before the joint, and its inverse behind it."""
    turn = rotation_of(placed.values)
    before = built(f"{e.name}_axis_tilt", about(home_position(e), turn))
    return (before, e, built(f"{e.name}_axis_tilt_back", Pose.of(rotation=turn.T)))


EFFECT = EffectType(
    kind="axis_tilt",
    precedence=180,
    title="direction of a guide or joint axis alone",
    doc=(
        "The axis of a guide or joint is turned, and nothing else: at its zero (a guide: at the carriage's "
        "home position) whatever the joint carries stands as declared. A rotation about the axis itself "
        "does nothing."
    ),
    **rotations("rotation of the axis"),
    **each(joints, tilted),
    pivot="home position of the carriage; origin of a revolute joint",
    frame="local axes before the joint; about x, then the turned y, then the twice turned z",
    moves="the axis alone",
    excludes=("axis_tilt",),
    stage=45,
)
