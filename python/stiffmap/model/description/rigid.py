"""What decides where the joints of a machine close: its nominal geometry, whatever gives way in it."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import replace
from functools import lru_cache

from stiffmap.model.description.elements import Body, Element, Joint, Offset, Spring
from stiffmap.model.description.laws import Law
from stiffmap.model.description.machine import MachineDescription
from stiffmap.model.description.tree import Elements, edit_elements

KEPT = 128
"""Sequences whose geometry is kept: variants of a machine share most of theirs."""


def nominal_geometry(description: MachineDescription) -> Hashable:
    """Equal for machines whose joints close at the same places: they differ in springs, laws, masses and errors only."""
    d = description
    parts = (_nominal_elements(d.base), _nominal_elements(d.platform))
    legs = tuple((leg.name, _nominal_elements(leg.elements)) for leg in d.legs)
    return *parts, legs, d.home, d.search_home, d.task, d.workspace


def straight(description: MachineDescription) -> MachineDescription:
    """The machine with linear drives and link springs; itself where they are."""
    d = description
    legs = tuple(replace(leg, elements=edit_elements(leg.elements, _straight)) for leg in d.legs)
    ends = edit_elements(d.base, _straight), edit_elements(d.platform, _straight)
    if (*ends, legs) == (d.base, d.platform, d.legs):
        return description
    return replace(d, base=ends[0], platform=ends[1], legs=legs, effects=(), declared=None)


@lru_cache(maxsize=KEPT)
def _nominal_elements(elements: Elements) -> Elements:
    return edit_elements(elements, _nominal)


def _nominal(e: Element) -> Element:
    match e:
        case Offset():
            return replace(e, actual=None)
        case Joint():
            bare = replace(e, compliance_slope=0.0, command_errors=(), guide_errors=(), friction=None)
            return replace(bare, law=None, axis_laws=(), rest=None, drive=None)
        case Spring():
            return Spring(e.name)
        case Body():
            return Body(e.name, 0.0)
    return e


def _straight(e: Element) -> Element:
    match e:
        case Joint(actuated=True, law=Law(stiffness=k)):
            return replace(e, law=Law(k))
        case Spring(laws=(_, *_)):
            return replace(e, laws=())
    return e
