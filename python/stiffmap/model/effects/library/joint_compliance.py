"""Compliance of pins."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from stiffmap.model.description import Joint, MachineDescription, Spring
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.edit import edit_legs, splice
from stiffmap.model.effects.library.spring import PARAMETERS, isotropic
from stiffmap.model.effects.sites import at_sites, passive_joints, springs
from stiffmap.model.effects.types import EffectType, Placed


def pins(elements: Elements) -> dict[str, tuple[int, ...]]:
    """Passive joints by their names, and the two next to a link by the name of the link's spring."""
    single = passive_joints(elements)
    out = dict(single)
    for name, at in springs(elements).items():
        around = tuple(
            i for k in at for i in (_next(elements, k, -1), _next(elements, k, 1)) if i is not None
        )
        out.update({name: around} if len(around) == 2 * len(at) and name not in single else {})
    return out


def _next(elements: Elements, k: int, way: int) -> int | None:
    i = k + way
    while 0 <= i < len(elements):
        e = elements[i]
        if isinstance(e, Joint):
            return None if e.actuated else i
        if isinstance(e, Spring):
            return None
        i += way
    return None


def insert(
    description: MachineDescription, placed: Placed, piece: Callable[[Joint], Elements]
) -> MachineDescription:
    """``piece`` on the link's side of each pin: behind the pin unless the link comes before it."""

    def edit(elements: Elements) -> Elements:
        link = springs(elements).get(placed.element)
        out = elements
        for i in reversed(pins(elements).get(placed.element, ())):
            pin = elements[i]
            assert isinstance(pin, Joint)
            new = tuple(replace(e, name=f"{pin.name}_{e.name}") for e in piece(pin))
            out = splice(out, i, (*new, pin) if link and i > link[0] else (pin, *new))
        return out

    return edit_legs(description, placed.legs, edit)


def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
    """An isotropic spring at each pin."""
    spring = Spring("compliance", compliance=isotropic(placed))
    return insert(description, placed, lambda pin: (spring,))


EFFECT = EffectType(
    kind="joint_compliance",
    precedence=230,
    title="compliance of passive joints (pins, bearings)",
    doc=(
        "An isotropic spring in translation and rotation between a passive joint and the link that it "
        "carries. A link's name stands for the pins at both of its ends, a joint's name for that joint "
        "alone."
    ),
    parameters=PARAMETERS,
    places=at_sites(pins),
    apply=apply,
    pivot="centre of the joint",
    frame="axes of the link (isotropic)",
    moves="all behind the joint",
    vector=("translation", "rotation"),
    excludes=("joint_compliance",),
    stage=50,
)
