"""Clearance of pins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stiffmap.model.description import Joint, Law, MachineDescription, Offset, Pose, Spring
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.library.joint_compliance import insert, pins
from stiffmap.model.effects.sites import at_sites
from stiffmap.model.effects.types import EffectType, Parameter, Placed

CONTACT = 1e12  # N/m behind the gap: a quarter of a nanometre at 250 N
CENTRING = 1.0  # N at the ends of the gap, rising linearly from its centre: no pin is undetermined
HOLDS = 1e7  # N: more than any pin bears


def revolute_pins(elements: Elements) -> dict[str, tuple[int, ...]]:
    """Passive revolute joints and the two next to a link."""
    turning = {i for i, e in enumerate(elements) if isinstance(e, Joint) and e.kind == "revolute"}
    return {n: at for n, at in pins(elements).items() if turning.issuperset(at)}


def gap(radius: float) -> Law:
    """Hardly any force within the radius, contact at its ends; rigid at radius zero."""
    if radius == 0.0:
        return Law(CONTACT, knots=((0.0, -HOLDS), (0.0, HOLDS)))
    return Law(CONTACT, knots=((-radius, -CENTRING), (radius, CENTRING)))


def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
    """A rigid spring with gaps in the two directions across the axis, at each pin."""
    law = gap(placed.values["radius"])
    rigid = tuple((0.0,) * 6 for _ in range(6))
    spring = Spring("clearance", compliance=rigid, laws=((1, law), (2, law)))

    def piece(e: Joint) -> Elements:
        turn = Pose.of(rotation=_axis_first(np.array(e.axes[0])))
        return (Offset("clearance_frame", turn), spring, Offset("clearance_back", turn.inverse()))

    return insert(description, placed, piece)


def _axis_first(axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation (3, 3) whose x is the axis; a permutation for a coordinate axis."""
    k = int(np.argmax(np.abs(axis)))
    across = np.eye(3)[(k + 1) % 3]
    y = across - axis * (axis @ across)
    y /= np.linalg.norm(y)
    return np.column_stack([axis, y, np.cross(axis, y)])


EFFECT = EffectType(
    kind="joint_clearance",
    precedence=240,
    reverses=True,
    title="clearance of pins",
    doc=(
        "Radial play of revolute joints: a gap of ± `radius` in each of the two directions across the axis "
        "(a square, not a circle: at 45° it is 41 % wider). A centring force that rises to 1 N at the ends "
        "of the gap keeps unloaded pins determinate; the contact behind yields 1e-12 m/N. A link's name "
        "stands for the pins at both of its ends."
    ),
    parameters=(Parameter("radius", "m", 0.0, 0.01, 0.0, 1e-5, "radial play"),),
    places=at_sites(revolute_pins),
    apply=apply,
    pivot="centre of the joint",
    frame="axes of the link, across the joint's axis",
    moves="all behind the joint",
    excludes=("joint_clearance",),
    stage=55,
)
