"""Full names of the elements of a description."""

from __future__ import annotations

from collections.abc import Iterator

from stiffmap.description.elements import Block, Element, Point
from stiffmap.description.machine import MachineDescription


def walk(elements: tuple[Element, ...], name: str) -> Iterator[tuple[str, Element]]:
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
