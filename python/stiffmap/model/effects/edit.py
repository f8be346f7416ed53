"""Editing the sequences of a machine: pure functions on its description."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from stiffmap.common.broadcasting import Floats
from stiffmap.model.description import MachineDescription, Offset, Pose
from stiffmap.model.description.tree import ENDS, Edit, Elements, edit_all, edit_named, in_sequence

Sites = Callable[[Elements], dict[str, tuple[int, ...]]]
Change = Callable[[Any], Elements]


def edit_legs(
    description: MachineDescription,
    legs: tuple[str, ...],
    element: str,
    edit: Callable[[Elements, str], Elements],
) -> MachineDescription:
    """``edit`` on every sequence of the legs named, with what the element is called there; without legs on those of base and
    platform."""

    def inside(elements: Elements, name: str) -> Elements:
        return edit(elements, in_sequence(element, name))

    return edit_chains(description, legs or ENDS, lambda elements: edit_named(elements, "", inside))


def edit_chains(description: MachineDescription, chains: tuple[str, ...], edit: Edit) -> MachineDescription:
    """``edit`` on the whole of each leg, or end, that is named."""
    return edit_all(description, lambda elements, name: edit(elements) if name in chains else elements)


def change_sites(
    description: MachineDescription, legs: tuple[str, ...], element: str, sites: Sites, change: Change
) -> MachineDescription:
    """Each element that ``sites`` finds under the name becomes the elements that ``change`` gives."""

    def edit(elements: Elements, name: str) -> Elements:
        out = elements
        for i in reversed(sites(elements).get(name, ())):
            out = splice(out, i, change(elements[i]))
        return out

    return edit_legs(description, legs, element, edit)


def splice(elements: Elements, i: int, piece: Elements) -> Elements:
    """``piece`` in the place of element ``i``; what is new in it gets names that are free."""
    out = list(elements[:i] + elements[i + 1 :])
    for k, e in enumerate(piece):
        kept = e.name == elements[i].name
        out.insert(i + k, e if kept else replace(e, name=fresh(e.name, tuple(out) + (elements[i],))))
    return tuple(out)


def fresh(name: str, elements: Elements) -> str:
    """``name``, with a number after it where the sequence has that name already."""
    taken = {e.name for e in elements}
    numbered = (f"{name}_{i}" for i in range(2, len(taken) + 3))
    return name if name not in taken else next(n for n in numbered if n not in taken)


def built(name: str, pose: Pose) -> Offset:
    """An error of the machine as built: nothing to the controller, ``pose`` in truth."""
    return Offset(name, Pose(), pose)


def shifted(e: Offset, step: Floats) -> Offset:
    """An offset built longer by a vector (3,) m than it is; the controller keeps the nominal one."""
    actual = e.actual or e.nominal
    return replace(e, actual=Pose.of(actual.p + step, actual.r))
