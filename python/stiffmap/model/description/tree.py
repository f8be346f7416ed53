"""The tree of a machine: its sequences and elements by their full names, walked, found and edited.

A full name joins the names of leg (or ``base``, ``platform``), branches and element with dots; blocks do not
count: ``x.bar_low.bar``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

from stiffmap.model.description.elements import Block, Body, Element, Joint, Offset, Point
from stiffmap.model.description.machine import MachineDescription

Elements = tuple[Element, ...]
Edit = Callable[[Elements], Elements]
Change = Callable[[Element], Element | None]
"""None: the element stays as it is."""
ENDS = ("base", "platform")


def walk(elements: Elements, name: str) -> Iterator[tuple[str, Element]]:
    """Every element of a sequence with its full name, those inside blocks included."""
    for element in elements:
        yield f"{name}.{element.name}", element
        if isinstance(element, Block):
            for branch in element.branches:
                yield from walk(branch.elements, f"{name}.{branch.name}")


def chains(description: MachineDescription) -> list[tuple[str, Elements]]:
    """The base, each leg and the platform, with their names."""
    legs = [(leg.name, leg.elements) for leg in description.legs]
    return [("base", description.base), *legs, ("platform", description.platform)]


def all_elements(description: MachineDescription) -> Iterator[tuple[str, Element]]:
    """Every element of a machine with its full name, from base to platform."""
    for name, elements in chains(description):
        yield from walk(elements, name)


def point_names(description: MachineDescription) -> list[str]:
    """Full names of the named points."""
    return [name for name, element in all_elements(description) if isinstance(element, Point)]


def spring_points(description: MachineDescription) -> list[str]:
    """``tcp`` and the named points, where an external spring may pull."""
    return ["tcp", *point_names(description)]


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
    chain = full.partition(".")[0]
    elements = dict(chains(description)).get(chain, ())
    return [element for name, element in walk(elements, chain) if name == full]


def offset_before(elements: Sequence[Element], k: int) -> int | None:
    """Index of the offset that is the length of the link at whose end element ``k`` stands; None: there is none."""
    i = next((i for i in reversed(range(k)) if not isinstance(elements[i], (Body, Point))), None)
    before = None if i is None else elements[i]
    return i if isinstance(before, Offset) and any(before.nominal.translation) else None


def sequences(elements: Elements, name: str = "") -> Iterator[tuple[str, Elements]]:
    """A sequence and those of the branches in it, each with the names of the branches that lead to it: ``.low``."""
    yield name, elements
    for element in elements:
        if isinstance(element, Block):
            for branch in element.branches:
                yield from sequences(branch.elements, f"{name}.{branch.name}")


def in_sequence(element: str, name: str) -> str:
    """What an element is called inside a sequence of this name: ``bar`` for ``low.bar`` in ``.low``; else the same."""
    return element.removeprefix(f"{name[1:]}.") if name else element


def edit_named(elements: Elements, name: str, edit: Callable[[Elements, str], Elements]) -> Elements:
    """The sequence with ``edit`` applied to it and to those of the branches in it, each with its full name."""

    def inside(element: Element) -> Element:
        if not isinstance(element, Block):
            return element
        branches = (
            replace(b, elements=edit_named(b.elements, f"{name}.{b.name}", edit)) for b in element.branches
        )
        return replace(element, branches=tuple(branches))

    return edit(tuple(inside(element) for element in elements), name)


def edit_sequences(elements: Elements, edit: Edit) -> Elements:
    """The same with an ``edit`` that asks for no names."""
    return edit_named(elements, "", lambda sequence, name: edit(sequence))


def edit_elements(elements: Elements, change: Callable[[Element], Element]) -> Elements:
    """The sequence with ``change`` applied to every element but blocks, those in branches included."""
    return edit_sequences(
        elements, lambda sequence: tuple(e if isinstance(e, Block) else change(e) for e in sequence)
    )


def edit_all(
    description: MachineDescription, edit: Callable[[Elements, str], Elements]
) -> MachineDescription:
    """The machine with ``edit`` applied to the whole of each leg, base and platform, whose name it is given."""
    edited = [edit(leg.elements, leg.name) for leg in description.legs]
    legs = tuple(
        leg if new is leg.elements else replace(leg, elements=new)
        for leg, new in zip(description.legs, edited, strict=True)
    )
    base, platform = (edit(getattr(description, end), end) for end in ENDS)
    return replace(description, legs=legs, base=base, platform=platform)


def edit_path(elements: Elements, path: str, change: Change) -> Elements | None:
    """The sequence with the elements of a name (branches, then element) changed; None: nothing was."""
    changed = False

    def edit(sequence: Elements, name: str) -> Elements:
        nonlocal changed
        new = [change(e) if f"{name}.{e.name}" == f".{path}" else None for e in sequence]
        changed |= any(new)
        return tuple(e or old for e, old in zip(new, sequence, strict=True))

    edited = edit_named(elements, "", edit)
    return edited if changed else None


def edit(description: MachineDescription, full: str, change: Change) -> MachineDescription | None:
    """The machine with the elements of a full name changed; None: there are none that ``change`` changes."""
    chain, _, path = full.partition(".")
    edited = edit_path(dict(chains(description)).get(chain, ()), path, change)
    if edited is None:
        return None
    return edit_all(description, lambda elements, name: edited if name == chain else elements)
