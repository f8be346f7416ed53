"""What the effects on the force law of a drive, an elastic joint or a spring's direction share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import Joint, Law, MachineDescription, Spring
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.edit import change_sites
from stiffmap.model.effects.sites import at_sites, elastic_directions, elastic_drives
from stiffmap.model.effects.types import Placed, entry_of


def change_law(
    description: MachineDescription, placed: Placed, change: Callable[[Law], Law]
) -> MachineDescription:
    """The machine with another law at each joint or spring direction of the place."""
    i = entry_of(placed.element)[1]

    def element(e: Any) -> Elements:
        if isinstance(e, Joint):
            assert e.law is not None
            return (replace(e, law=change(e.law)),)
        assert i is not None
        laws = {**dict(e.laws), i: change(dict(e.laws).get(i) or Law(_stiffness(e, i)))}
        return (replace(e, laws=tuple(sorted(laws.items(), key=lambda pair: pair[0]))),)

    return change_sites(description, placed.legs, placed.element, elastic_directions, element)


def on_law(law: Callable[[Law, Placed], Law], **more: Any) -> dict[str, Any]:
    """What effects share that make another law of that at their place; `more` as in `EffectType`."""
    return {
        "places": at_sites(elastic_directions),
        "apply": lambda machine, placed: change_law(machine, placed, lambda old: law(old, placed)),
        "tried": at_sites(elastic_drives),
        "frame": "the coordinate",
        "stage": 10,
        **more,
    }


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
