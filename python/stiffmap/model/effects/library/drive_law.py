"""What the effects on the force law of a drive, an elastic joint or a spring's direction share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import Joint, Law, MachineDescription, Spring
from stiffmap.model.description.tree import Elements, all_elements
from stiffmap.model.effects.edit import change_sites
from stiffmap.model.effects.sites import elastic_directions
from stiffmap.model.effects.types import Apply, Parameter, ParametersAt, Placed


def change_law(
    description: MachineDescription, placed: Placed, change: Callable[[Law], Law]
) -> MachineDescription:
    """The machine with another law at each joint or spring direction of the place."""
    entry = placed.element.partition(".")[2]

    def element(e: Any) -> Elements:
        if isinstance(e, Joint):
            assert e.law is not None
            return (replace(e, law=change(e.law)),)
        i = int(entry[1]) - 1
        laws = {**dict(e.laws), i: change(dict(e.laws).get(i) or Law(_stiffness(e, i)))}
        return (replace(e, laws=tuple(sorted(laws.items(), key=lambda pair: pair[0]))),)

    return change_sites(description, placed.legs, placed.element, elastic_directions, element)


def changing_law(change: Callable[[Law, Placed], Law]) -> Apply:
    """The ``apply`` of an effect that makes another law of that at its place."""
    return lambda description, placed: change_law(description, placed, lambda old: change(old, placed))


def _stiffness(e: Spring, i: int) -> float:
    if e.stiffness is not None:
        return e.stiffness[i][i]
    assert e.compliance is not None
    return 1.0 / e.compliance[i][i]


def linear(law: Law) -> Law:
    """The law, which must be linear yet; raises StiffmapError."""
    if law.cubic or law.knots:
        raise StiffmapError("the drive has a declared nonlinear law already, which this effect cannot join")
    return law


def is_revolute(description: MachineDescription, element: str) -> bool:
    """Whether the joint of that name, or the spring's direction (``foot.k44``), turns."""
    entry = element.partition(".")[2]
    if entry:
        return int(entry[1]) > 3
    named = [e for _, e in all_elements(description) if e.name == element]
    return any(isinstance(e, Joint) and e.kind != "prismatic" for e in named)


def in_unit_of_joint(*parameters: Parameter) -> ParametersAt:
    """Parameters whose units become the angular ones where the joint turns."""

    turning = tuple(
        replace(
            p,
            unit=p.angular or p.unit,
            upper=p.angular_upper or p.upper,
            scale=p.angular_scale or p.scale,
        )
        for p in parameters
    )

    def at(description: MachineDescription, element: str, legs: tuple[str, ...]) -> tuple[Parameter, ...]:
        return turning if is_revolute(description, element) else parameters

    return at
