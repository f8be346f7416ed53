"""The tree of a machine: its sequences and elements by their full names, walked, found and edited.

A full name joins the names of leg (or ``base``, ``platform``), branches and element with dots; blocks do not
count: ``x.bar_low.bar``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

from stiffmap.model.description.elements import Block, Body, Branch, Element, Joint, Offset, Point
from stiffmap.model.description.machine import Leg, MachineDescription

Elements = tuple[Element, ...]
Edit = Callable[[Elements], Elements]
Change = Callable[[Element], Element | None]
"""None: the element stays as it is."""
ENDS = ("base", "platform")
Holder = TypeVar("Holder", Leg, Branch)


def walk(elements: Elements, name: str) -> Iterator[tuple[str, Element]]:
    """Every element of a sequence with its full name, those inside blocks included."""
    for element in elements:
        yield f"{name}.{element.name}", element
        if isinstance(element, Block):
            for branch in element.branches:
                yield from walk(branch.elements, f"{name}.{branch.name}")


def all_elements(description: MachineDescription) -> Iterator[tuple[str, Element]]:
    """Every element of a machine with its full name, from base to platform."""
    yield from walk(description.base, "base")
    for leg in description.legs:
        yield from walk(leg.elements, leg.name)
    yield from walk(description.platform, "platform")


def point_names(description: MachineDescription) -> list[str]:
    """Full names of the named points."""
    return [name for name, element in all_elements(description) if isinstance(element, Point)]


def core_name(full: str) -> str:
    """What the core, and so an actuator or a coordinate, is called: without ``base.`` or ``platform.``."""
    sequence, _, rest = full.partition(".")
    return rest if sequence in ENDS else full


def joints(description: MachineDescription) -> dict[str, Joint]:
    """The joints by the names that the core gives them."""
    return {core_name(n): e for n, e in all_elements(description) if isinstance(e, Joint)}


def of_same_sequence(full: str, name: str) -> str:
    """The full name of another element of the sequence that an element is in."""
    return f"{full.rpartition('.')[0]}.{name}".lstrip(".")


def joint_of(named: Mapping[str, Joint], coordinate: str) -> Joint | None:
    """The joint, among those that `joints` gives, of a coordinate: ``name``, or ``name.2`` where it has several."""
    return named.get(coordinate) or named.get(coordinate.rpartition(".")[0])


def find(description: MachineDescription, full: str) -> list[Element]:
    """The elements of a full name: a body and a point may share theirs with another sort of element."""
    return [element for name, element in all_elements(description) if name == full]


def offset_before(elements: Sequence[Element], k: int) -> int | None:
    """Index of the offset that is the length of the link at whose end element ``k`` stands; None: there is none."""
    i = next((i for i in reversed(range(k)) if not isinstance(elements[i], (Body, Point))), None)
    before = None if i is None else elements[i]
    return i if isinstance(before, Offset) and any(before.nominal.translation) else None


def sequences(elements: Elements) -> Iterator[Elements]:
    """A sequence and those of the branches in it."""
    yield elements
    for element in elements:
        if isinstance(element, Block):
            for branch in element.branches:
                yield from sequences(branch.elements)


def edit_sequences(elements: Elements, edit: Edit) -> Elements:
    """The sequence with ``edit`` applied to it and to those of the branches in it."""

    def inside(element: Element) -> Element:
        if not isinstance(element, Block):
            return element
        branches = tuple(replace(b, elements=edit_sequences(b.elements, edit)) for b in element.branches)
        return replace(element, branches=branches)

    return edit(tuple(inside(element) for element in elements))


def edit_elements(elements: Elements, change: Callable[[Element], Element]) -> Elements:
    """The sequence with ``change`` applied to every element but blocks, those in branches included."""
    return edit_sequences(
        elements, lambda sequence: tuple(e if isinstance(e, Block) else change(e) for e in sequence)
    )


def edit_all(
    description: MachineDescription, edit: Callable[[Elements, str], Elements]
) -> MachineDescription:
    """The machine with ``edit`` applied to the whole of each leg, base and platform, whose name it is given."""
    legs = tuple(replace(leg, elements=edit(leg.elements, leg.name)) for leg in description.legs)
    base, platform = (edit(getattr(description, end), end) for end in ENDS)
    return replace(description, legs=legs, base=base, platform=platform)


def edit_path(elements: Elements, path: str, change: Change) -> Elements | None:
    """The sequence with the elements of a name (branches, then element) changed; None: nothing was."""
    first, _, rest = path.partition(".")
    out, hit = list(elements), False
    for i, element in enumerate(elements):
        new: Element | None = None
        if element.name == path:
            new = change(element)
        elif rest and isinstance(element, Block):
            branches = _edit_one(element.branches, first, rest, change)
            new = None if branches is None else replace(element, branches=branches)
        if new is not None:
            out[i], hit = new, True
    return tuple(out) if hit else None


def _edit_one(among: tuple[Holder, ...], name: str, path: str, change: Change) -> tuple[Holder, ...] | None:
    """Legs, or branches, with the elements of a name in one of them changed; None: nothing was."""
    edited = {one.name: edit_path(one.elements, path, change) for one in among if one.name == name}
    if not any(edited.values()):
        return None
    return tuple(replace(one, elements=edited.get(one.name) or one.elements) for one in among)


def edit(description: MachineDescription, full: str, change: Change) -> MachineDescription | None:
    """The machine with the elements of a full name changed; None: there are none that ``change`` changes."""
    sequence, _, path = full.partition(".")
    if sequence in ENDS:
        end = edit_path(getattr(description, sequence), path, change)
        if end is None:
            return None
        return replace(description, base=end) if sequence == "base" else replace(description, platform=end)
    legs = _edit_one(description.legs, sequence, path, change)
    return None if legs is None else replace(description, legs=legs)
