"""Home coordinates of single joints of a leg, where they differ from the template's."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.description import Block, Branch, Element, Joint
from stiffmap.errors import FileError
from stiffmap.files.build_elements import home_coordinates
from stiffmap.files.context import Context
from stiffmap.files.schema.base import Number, suggestion
from stiffmap.units import ANGLE, LENGTH

Home = Number | list[Number]


def with_home(
    elements: tuple[Element, ...], names: list[str], home: Home, context: Context
) -> tuple[Element, ...]:
    """The sequence with other home coordinates of the joint ``names`` (branches, then joint)."""
    for i, element in enumerate(elements):
        changed: Element | None = None
        if isinstance(element, Joint) and names == [element.name]:
            changed = _joint(element, home, context)
        elif isinstance(element, Block) and len(names) > 1:
            changed = _block(element, names, home, context)
        if changed is not None:
            return (*elements[:i], changed, *elements[i + 1 :])
    raise _unknown(elements, names[0], context)


def _joint(joint: Joint, home: Home, context: Context) -> Joint:
    numbers = home if isinstance(home, list) else [home]
    if len(numbers) != len(joint.axes):
        context.fail(f"joint '{joint.name}' has {len(joint.axes)} coordinates; found {len(numbers)}")
    dimension = LENGTH if joint.kind == "prismatic" else ANGLE
    return replace(joint, home=home_coordinates(numbers, dimension, context))


def _block(block: Block, names: list[str], home: Home, context: Context) -> Block | None:
    if names[0] not in [branch.name for branch in block.branches]:
        return None
    branches = tuple(
        Branch(b.name, with_home(b.elements, names[1:], home, context)) if b.name == names[0] else b
        for b in block.branches
    )
    return replace(block, branches=branches)


def _unknown(elements: tuple[Element, ...], name: str, context: Context) -> FileError:
    known = [e.name for e in elements if isinstance(e, Joint)]
    known += [b.name for e in elements if isinstance(e, Block) for b in e.branches]
    there = ", ".join(known) or "none"
    return context.error(f"no joint or branch '{name}'{suggestion(name, known)}; there are: {there}")
