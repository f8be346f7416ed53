"""What decides where the joints of a machine close: its nominal geometry, whatever gives way in it."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import replace

from stiffmap.description.elements import Block, Body, Element, Joint, Offset, Spring
from stiffmap.description.laws import Law
from stiffmap.description.machine import MachineDescription
from stiffmap.description.tree import Elements, edit_sequences

Change = Callable[[Element], Element]


def nominal_geometry(description: MachineDescription) -> Hashable:
    """Equal for machines whose joints close at the same places: they differ in springs, laws, masses and errors only."""
    d = _edited(description, _nominal)
    return d.base, d.legs, d.platform, d.home, d.search_home, d.task, d.workspace


def straight(description: MachineDescription) -> MachineDescription:
    """The machine with linear drives and link springs; itself where they are."""
    d = _edited(description, _straight)
    return description if (d.base, d.legs, d.platform) == _elements(description) else d


def _elements(d: MachineDescription) -> tuple[object, ...]:
    return d.base, d.legs, d.platform


def _edited(d: MachineDescription, change: Change) -> MachineDescription:
    def each(elements: Elements) -> Elements:
        return tuple(e if isinstance(e, Block) else change(e) for e in elements)

    legs = tuple(replace(leg, elements=edit_sequences(leg.elements, each)) for leg in d.legs)
    ends = (edit_sequences(d.base, each), edit_sequences(d.platform, each))
    return replace(d, base=ends[0], legs=legs, platform=ends[1], effects=(), declared=None)


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
