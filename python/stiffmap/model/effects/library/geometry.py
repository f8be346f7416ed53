"""Geometric errors of frames and axes; three translations or three rotations as parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.rotations import rotation_about
from stiffmap.model.description import Joint, MachineDescription, Offset, Pose
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.edit import built, change_sites, edit_chains, fresh, splice
from stiffmap.model.effects.sites import at, at_sites, each, joints, per_leg
from stiffmap.model.effects.types import EffectType, Parameter, Place, Placed

AXES = "xyz"


def components(parameters: Iterable[Parameter]) -> dict[str, Any]:
    """``parameters`` and ``vector`` of an effect that has these parameters only."""
    known = tuple(parameters)
    return {"parameters": known, "vector": tuple(p.name for p in known)}


def translations(doc: str, prefix: str = "error_") -> dict[str, Any]:
    """`components` ``error_x``, ``error_y``, ``error_z`` (m)."""
    return components(Parameter(f"{prefix}{a}", "m", -0.1, 0.1, 0.0, 1e-4, f"{doc} along {a}") for a in AXES)


def rotations(doc: str) -> dict[str, Any]:
    """`components` ``angle_x``, ``angle_y``, ``angle_z`` (rad)."""
    return components(Parameter(f"angle_{a}", "rad", -0.1, 0.1, 0.0, 1e-4, f"{doc} about {a}") for a in AXES)


def translation_of(values: Mapping[str, float], prefix: str = "error_") -> NDArray[np.float64]:
    """(3,) m."""
    return np.array([values.get(f"{prefix}{a}", 0.0) for a in AXES])


def rotation_of(values: Mapping[str, float], share: float = 1.0) -> NDArray[np.float64]:
    """(3, 3) Rx·Ry·Rz: about x, then about the turned y, then about the twice turned z."""
    out = np.eye(3)
    for a, axis in zip(AXES, np.eye(3), strict=True):
        out = out @ rotation_about(axis, share * values.get(f"angle_{a}", 0.0))
    return out


def point(prefix: str, doc: str, reach: float = 100.0) -> tuple[Parameter, ...]:
    """``prefix_x``, ``prefix_y``, ``prefix_z`` (m) of a known point, at the origin where they are left out."""
    return tuple(
        Parameter(f"{prefix}_{a}", "m", -reach, reach, None, 0.1, f"{doc}, {a}", default=0.0, fitted=False)
        for a in AXES
    )


def about(pivot: NDArray[np.float64], rotation: NDArray[np.float64]) -> Pose:
    """The rotation about a pivot (3,) m."""
    return Pose.of(pivot - rotation @ pivot, rotation)


def home_position(joint: Joint) -> NDArray[np.float64]:
    """(3,) m, the frame behind the joint at home, in the frame before it."""
    slides = joint.kind == "prismatic"
    return np.array(joint.axes[0]) * joint.home[0] if slides else np.zeros(3)


def tilted(e: Joint, placed: Placed) -> Elements:
    """A rotation about the joint's home position, before the joint."""
    return (built(f"{e.name}_tilt", about(home_position(e), rotation_of(placed.values))), e)


TILT = EffectType(
    kind="tilt",
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


def axis_tilted(e: Joint, placed: Placed) -> Elements:
    """The rotation before the joint, and its inverse behind it."""
    turn = rotation_of(placed.values)
    before = built(f"{e.name}_axis_tilt", about(home_position(e), turn))
    return (before, e, built(f"{e.name}_axis_tilt_back", Pose.of(rotation=turn.T)))


AXIS_TILT = EffectType(
    kind="axis_tilt",
    title="direction of a guide or joint axis alone",
    doc=(
        "The axis of a guide or joint is turned, and nothing else: at its zero (a guide: at the carriage's "
        "home position) whatever the joint carries stands as declared. A rotation about the axis itself "
        "does nothing."
    ),
    **rotations("rotation of the axis"),
    **each(joints, axis_tilted),
    pivot="home position of the carriage; origin of a revolute joint",
    frame="local axes before the joint; about x, then the turned y, then the twice turned z",
    moves="the axis alone",
    excludes=("axis_tilt",),
    stage=45,
)


def leg_tilted(description: MachineDescription, placed: Placed) -> MachineDescription:
    """A rotation at the end of the offsets with which the leg begins."""
    turn = built("leg_tilt", Pose.of(rotation=rotation_of(placed.values)))

    def turned(elements: Elements) -> Elements:
        i = next((i for i, e in enumerate(elements) if not isinstance(e, Offset)), 0)
        return splice(elements, i, (turn, elements[i]))

    return edit_chains(description, placed.legs, turned)


LEG_TILT = EffectType(
    kind="leg_tilt",
    title="whole leg mounted askew",
    doc="The whole leg is mounted on the base turned about the origin of its frame.",
    **rotations("rotation"),
    places=per_leg("base"),
    apply=leg_tilted,
    pivot="origin of the leg's frame on the base",
    frame="axes of the leg's frame; about x, then the turned y, then the twice turned z",
    moves="the whole leg up to the platform",
    excludes=("leg_tilt",),
    stage=25,
)


def joints_and_ends(description: MachineDescription) -> list[Place]:
    """Joints, and the two ends of each leg."""
    return at_sites(joints)(description) + per_leg("base")(description) + per_leg("platform")(description)


def displaced(description: MachineDescription, placed: Placed) -> MachineDescription:
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


POSITION_OFFSET = EffectType(
    kind="position_offset",
    title="line of a guide or joint axis; base and platform joint points",
    doc=(
        "A joint (guide) stands displaced on the part that carries it. On `base` the leg's beginning stands "
        "displaced in base axes; on `platform` the point where the leg holds the platform is displaced in "
        "platform axes. Along a prismatic drive it is its zero offset; with `tilt` it is the line of the "
        "axis."
    ),
    **translations("displacement"),
    places=joints_and_ends,
    apply=displaced,
    frame="axes of the frame before the joint at its zero; base axes; platform axes",
    moves="the joint and all that it carries, up to the platform; nothing turns",
    stage=30,
)


def tool_displaced(description: MachineDescription, placed: Placed) -> MachineDescription:
    """An offset behind all platform elements."""
    new = built(fresh("tcp_offset", description.platform), Pose.of(translation_of(placed.values)))
    return replace(description, platform=(*description.platform, new))


TCP_OFFSET = EffectType(
    kind="tcp_offset",
    title="position of the tool on the platform",
    doc="The tool (TCP) sits displaced on the platform; the external wrench acts at the displaced TCP.",
    **translations("displacement of the tool"),
    places=at("platform"),
    apply=tool_displaced,
    frame="platform axes",
    moves="the TCP; other points and bodies of the platform stay",
    stage=60,
)
