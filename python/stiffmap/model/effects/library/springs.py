"""Springs where the description has none: at the base, at the tool, in pins."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stiffmap.model.description import Joint, Law, MachineDescription, Offset, Pose, Spring
from stiffmap.model.description.strokes import Matrix6, as_rows
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.edit import edit_legs, fresh, splice
from stiffmap.model.effects.library.geometry import point, translation_of
from stiffmap.model.effects.sites import at, at_sites, passive_joints, springs
from stiffmap.model.effects.types import EffectType, Parameter, Placed

PARAMETERS = (
    Parameter("translation", "m/N", 0.0, 1e-3, 0.0, 1e-9, "compliance of each translation"),
    Parameter("rotation", "rad/(N·m)", 0.0, 1.0, 0.0, 1e-7, "compliance of each rotation"),
)


def isotropic(placed: Placed) -> Matrix6:
    """6x6 compliance, diagonal; rigid at zero."""
    diagonal = [placed.values["translation"]] * 3 + [placed.values["rotation"]] * 3
    return as_rows(np.diag(diagonal))


def spring_at(end: str) -> dict[str, Any]:
    """What effects share that put an isotropic spring at a pivot, before all of the ``base`` or behind the ``platform``."""

    def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
        elements, pivot = getattr(description, end), translation_of(placed.values, "pivot_")
        name = fresh(placed.kind, elements)
        there, back = (Offset(f"{name}_{way}", Pose.of(p)) for way, p in (("there", pivot), ("back", -pivot)))
        new = (there, Spring(name, compliance=isotropic(placed)), back)
        changed: dict[str, Any] = {end: (*new, *elements) if end == "base" else (*elements, *new)}
        return replace(description, **changed)

    return {
        "parameters": (*PARAMETERS, *point("pivot", "where the spring sits")),
        "places": at(end),
        "apply": apply,
        "vector": ("translation", "rotation"),
        "stage": 50,
    }


BASE_COMPLIANCE = EffectType(
    kind="base_compliance",
    title="compliance of the base",
    doc=(
        "An isotropic spring in translation and rotation between the ground, from which readings are taken, "
        "and the machine's base."
    ),
    **spring_at("base"),
    pivot="the point `pivot_x`, `pivot_y`, `pivot_z` in base axes (default: origin of the base)",
    frame="base axes (isotropic)",
    moves="the whole machine",
    excludes=("base_compliance",),
    hidden=lambda plan: "base" in (plan.loop.instrument_on, plan.loop.force_against),
)


TOOL_COMPLIANCE = EffectType(
    kind="tool_compliance",
    title="compliance of tool and holder",
    doc=(
        "An isotropic spring in translation and rotation between the platform and the tool, on which the "
        "load acts and the reading is taken."
    ),
    **spring_at("platform"),
    pivot="the point `pivot_x`, `pivot_y`, `pivot_z` from the TCP in platform axes (default: the TCP)",
    frame="platform axes (isotropic)",
    moves="the TCP; other points and bodies of the platform stay",
    excludes=("tool_compliance",),
    behind_platform=True,
    hidden=lambda plan: plan.loop.target_on == "platform",
)


def pins(elements: Elements) -> dict[str, tuple[int, ...]]:
    """Passive joints by their names, and the two next to a link by the name of the link's spring."""
    single = passive_joints(elements)
    passive = {i for at in single.values() for i in at}
    row = [i for i, e in enumerate(elements) if isinstance(e, (Joint, Spring))]
    sides = {k: (before, after) for before, k, after in zip(row, row[1:], row[2:], strict=False)}
    links = {name: [i for k in at for i in sides.get(k, ())] for name, at in springs(elements).items()}
    ends = {name: tuple(at) for name, at in links.items() if at and passive.issuperset(at)}
    return single | {name: at for name, at in ends.items() if name not in single}


def insert(
    description: MachineDescription, placed: Placed, piece: Callable[[Joint], Elements]
) -> MachineDescription:
    """``piece`` on the link's side of each pin: behind the pin unless the link comes before it."""

    def edit(elements: Elements, name: str) -> Elements:
        link = springs(elements).get(name)
        out = elements
        for i in reversed(pins(elements).get(name, ())):
            pin = elements[i]
            assert isinstance(pin, Joint)
            new = tuple(replace(e, name=f"{pin.name}_{e.name}") for e in piece(pin))
            out = splice(out, i, (*new, pin) if link and i > link[0] else (pin, *new))
        return out

    return edit_legs(description, placed.legs, placed.element, edit)


def bars(elements: Elements) -> dict[str, tuple[int, ...]]:
    """The pins at both ends of a link."""
    return {name: at for name, at in pins(elements).items() if name in springs(elements)}


def with_springs(description: MachineDescription, placed: Placed) -> MachineDescription:
    """An isotropic spring at each pin."""
    spring = Spring("compliance", compliance=isotropic(placed))
    return insert(description, placed, lambda pin: (spring,))


JOINT_COMPLIANCE = EffectType(
    kind="joint_compliance",
    title="compliance of passive joints (pins, bearings)",
    doc=(
        "An isotropic spring in translation and rotation between a passive joint and the link that it "
        "carries. A link's name stands for the pins at both of its ends, a joint's name for that joint "
        "alone; one link of several in a block is named with its branch (`low.bar`)."
    ),
    parameters=PARAMETERS,
    places=at_sites(pins, apart=bars),
    apply=with_springs,
    pivot="centre of the joint",
    frame="axes of the link (isotropic)",
    moves="all behind the joint",
    vector=("translation", "rotation"),
    excludes=("joint_compliance",),
    stage=50,
)


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


def with_gaps(description: MachineDescription, placed: Placed) -> MachineDescription:
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


JOINT_CLEARANCE = EffectType(
    kind="joint_clearance",
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
    apply=with_gaps,
    pivot="centre of the joint",
    frame="axes of the link, across the joint's axis",
    moves="all behind the joint",
    excludes=("joint_clearance",),
    stage=55,
)
