"""Where in a sequence an effect may act: names that address elements, and their indices."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from stiffmap.model.description import Body, Cable, Element, Joint, MachineDescription, Offset, Spring
from stiffmap.model.description.tree import ENDS, Elements, chains, in_sequence, offset_before, sequences
from stiffmap.model.effects.edit import Sites, change_sites
from stiffmap.model.effects.types import Place, Placed, Places


def named(match: Callable[[Element], bool]) -> Sites:
    """The elements of a sequence that match, by their names."""

    def find(elements: Elements) -> dict[str, tuple[int, ...]]:
        found: dict[str, tuple[int, ...]] = {}
        for i, e in enumerate(elements):
            if match(e):
                found[e.name] = (*found.get(e.name, ()), i)
        return found

    return find


drives = named(lambda e: isinstance(e, Joint) and e.actuated)
"""Actuated joints."""
elastic_drives = named(lambda e: isinstance(e, Joint) and e.actuated and e.law is not None)
"""Actuated joints with a compliance."""
elastic_joints = named(lambda e: isinstance(e, Joint) and e.law is not None)
"""Joints with a law for all axes."""
guides = named(
    lambda e: isinstance(e, Joint) and e.actuated and e.kind == "prismatic" and not isinstance(e, Cable)
)
"""Actuated sliders."""
cables = named(lambda e: isinstance(e, Cable))
"""Cables and belts."""
led_cables = named(lambda e: isinstance(e, Cable) and e.lead > 0.0)
"""Cables with a lead between winch and guide."""
free_joints = named(lambda e: isinstance(e, Joint) and e.free)
"""Passive joints without a law."""
passive_joints = named(lambda e: isinstance(e, Joint) and not e.actuated)
"""Passive joints."""
joints = named(lambda e: isinstance(e, Joint) and not isinstance(e, Cable))
"""All joints; a cable is none."""
springs = named(lambda e: isinstance(e, Spring))
"""Link springs."""
bodies = named(lambda e: isinstance(e, Body))
"""Bodies."""
offsets = named(lambda e: isinstance(e, Offset) and bool(np.any(e.nominal.p)))
"""Offsets that are longer than zero."""


def elastic_directions(elements: Elements) -> dict[str, tuple[int, ...]]:
    """Elastic joints, and single directions of link springs by names such as ``foot.k22``, where no other
    direction is coupled to them."""
    out = elastic_joints(elements)
    for i in range(6):
        for name, at in named(partial(_alone, i))(elements).items():
            out[f"{name}.k{i + 1}{i + 1}"] = at
    return out


def _alone(i: int, e: Element) -> bool:
    if not isinstance(e, Spring):
        return False
    m = e.compliance or e.stiffness
    assert m is not None
    return m[i][i] > 0.0 and not any(m[i][k] or m[k][i] for k in range(6) if k != i)


def links(elements: Elements) -> dict[str, tuple[int, ...]]:
    """Offsets that are the length of a link, under the name of the spring at the link's end."""
    found: dict[str, tuple[int, ...]] = {}
    for name, at in springs(elements).items():
        lengths = tuple(i for k in at if (i := offset_before(elements, k)) is not None)
        found.update({name: lengths} if lengths else {})
    return found


def lengths(elements: Elements) -> dict[str, tuple[int, ...]]:
    """Links, and offsets by their own names."""
    return {**offsets(elements), **links(elements)}


def names(elements: Elements, sites: Sites) -> list[str]:
    """Names that a leg has for these sites, in their order, once each."""
    return list(dict.fromkeys(name for _, seq in sequences(elements) for name in sites(seq)))


def in_branches(elements: Elements, sites: Sites) -> list[str]:
    """Names that several branches of a leg have, each in one branch alone: ``low.bar``."""
    found = [(branch, name) for branch, seq in sequences(elements) for name in sites(seq)]
    count = Counter(name for _, name in found)
    return [f"{branch[1:]}.{name}" for branch, name in found if branch and count[name] > 1]


def found(
    description: MachineDescription, legs: tuple[str, ...], element: str, sites: Sites
) -> list[Element]:
    """The elements that a name stands for in these legs; without legs in base and platform."""
    there = [elements for name, elements in chains(description) if name in (legs or ENDS)]
    inside = ((seq, in_sequence(element, name)) for c in there for name, seq in sequences(c))
    return [seq[i] for seq, name in inside for i in sites(seq).get(name, ())]


def at_sites(sites: Sites, apart: Sites = lambda _: {}) -> Places:
    """Each name in each leg alone, then in all legs that have it; then those of base and platform; at last those of `apart` in one
    branch of one leg alone, where several branches have them."""

    def find(description: MachineDescription) -> list[Place]:
        having: dict[str, list[str]] = {}
        for leg in description.legs:
            for name in names(leg.elements, sites):
                having.setdefault(name, []).append(leg.name)
        out = [place for name, legs in having.items() for place in _alone_and_together(name, legs)]
        trunk = names((*description.base, *description.platform), sites)
        out += [(name, ()) for name in trunk if name not in having]
        return out + [(n, (leg.name,)) for leg in description.legs for n in in_branches(leg.elements, apart)]

    return find


def _alone_and_together(name: str, legs: list[str]) -> list[Place]:
    return [(name, (leg,)) for leg in legs] + ([(name, tuple(legs))] if len(legs) > 1 else [])


def each(
    sites: Sites, change: Callable[[Any, Placed], Elements], apart: Sites = lambda _: {}
) -> dict[str, Any]:
    """``places`` and ``apply`` of an effect that makes other elements of each one at its place; `apart`: as in `at_sites`."""

    def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
        return change_sites(description, placed.legs, placed.element, sites, lambda e: change(e, placed))

    return {"places": at_sites(sites, apart), "apply": apply}


def at(element: str) -> Places:
    """One place without legs."""
    return lambda description: [(element, ())]


def per_leg(element: str) -> Places:
    """A place that every leg has, such as its mount on the base."""

    def find(description: MachineDescription) -> list[Place]:
        return _alone_and_together(element, [leg.name for leg in description.legs])

    return find
