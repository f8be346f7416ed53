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
        "alone; one link of several in a block is named with its branch (`low.bar`)."
    ),
    parameters=PARAMETERS,
    places=at_sites(pins, apart=bars),
    apply=apply,
    pivot="centre of the joint",
    frame="axes of the link (isotropic)",
    moves="all behind the joint",
    vector=("translation", "rotation"),
    excludes=("joint_compliance",),
    stage=50,
)
