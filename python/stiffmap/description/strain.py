"""Does a machine without load stay where it is commanded?"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from stiffmap.description.elements import Block, Element, Joint, Offset, Spring
from stiffmap.description.machine import MachineDescription


def all_elements(description: MachineDescription) -> Iterator[Element]:
    """Every element of the machine, blocks opened."""
    parts: list[Iterable[Element]] = [description.base, description.platform]
    parts += [leg.elements for leg in description.legs]
    for elements in parts:
        yield from _opened(elements)


def _opened(elements: Iterable[Element]) -> Iterator[Element]:
    for e in elements:
        if isinstance(e, Block):
            for branch in e.branches:
                yield from _opened(branch.elements)
        else:
            yield e


def rests_at_command(description: MachineDescription) -> bool:
    """True where nothing but wrenches and gravity can deflect the machine: no geometric or command
    error, no preload, no external spring."""
    return not description.external_springs and not any(map(_strains, all_elements(description)))


def _strains(e: Element) -> bool:
    match e:
        case Offset():
            return e.actual is not None and e.actual != e.nominal
        case Joint():
            return bool(e.command_errors or e.guide_errors)
        case Spring():
            return any(e.rest)
    return False
