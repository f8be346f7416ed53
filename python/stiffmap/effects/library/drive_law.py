"""What the effects on a drive's force law share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from stiffmap.description import Element, Joint, Law, MachineDescription
from stiffmap.effects.edit import Elements, change_sites, sequences
from stiffmap.effects.sites import elastic_drives
from stiffmap.effects.types import Parameter, ParametersAt, Placed
from stiffmap.errors import StiffmapError


def change_law(
    description: MachineDescription, placed: Placed, change: Callable[[Law], Law]
) -> MachineDescription:
    """The machine with another law in each drive of the place."""

    def joint(e: Element) -> Elements:
        assert isinstance(e, Joint) and e.law is not None
        return (replace(e, law=change(e.law)),)

    return change_sites(description, placed.legs, placed.element, elastic_drives, joint)


def linear(law: Law) -> Law:
    """The law, which must be linear yet; raises StiffmapError."""
    if law.cubic or law.knots:
        raise StiffmapError("the drive has a declared nonlinear law already, which this effect cannot join")
    return law


def is_revolute(description: MachineDescription, element: str) -> bool:
    """Whether the joint of that name turns."""
    chains = [description.base, description.platform, *(leg.elements for leg in description.legs)]
    named = [e for c in chains for seq in sequences(c) for e in seq if e.name == element]
    return any(isinstance(e, Joint) and e.kind != "prismatic" for e in named)


def in_unit_of_joint(*parameters: Parameter) -> ParametersAt:
    """Parameters whose units become the angular ones where the joint turns."""

    def at(description: MachineDescription, element: str, legs: tuple[str, ...]) -> tuple[Parameter, ...]:
        if not is_revolute(description, element):
            return parameters
        return tuple(replace(p, unit=p.angular or p.unit) for p in parameters)

    return at
