"""Home coordinates of single joints of a leg, where they differ from the template's."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.common.errors import FileError
from stiffmap.common.units import ANGLE, LENGTH
from stiffmap.model.description import Joint
from stiffmap.model.description.tree import Elements, edit_path, walk
from stiffmap.model.files.build_elements import coordinates
from stiffmap.model.files.context import Context
from stiffmap.model.files.schema.base import Number, suggestion

Home = Number | list[Number]


def with_home(elements: Elements, path: str, home: Home, context: Context) -> Elements:
    """The sequence with other home coordinates of the joint ``path`` (branches, then joint)."""
    edited = edit_path(elements, path, lambda e: _joint(e, home, context) if isinstance(e, Joint) else None)
    if edited is None:
        raise _unknown(elements, path, context)
    return edited


def _joint(joint: Joint, home: Home, context: Context) -> Joint:
    numbers = home if isinstance(home, list) else [home]
    if len(numbers) != len(joint.axes):
        context.fail(f"joint '{joint.name}' has {len(joint.axes)} coordinates; found {len(numbers)}")
    dimension = LENGTH if joint.kind == "prismatic" else ANGLE
    return replace(joint, home=coordinates(numbers, dimension, context))


def _unknown(elements: Elements, path: str, context: Context) -> FileError:
    known = [name.partition(".")[2] for name, e in walk(elements, "") if isinstance(e, Joint)]
    there = ", ".join(known) or "none"
    return context.error(f"no joint '{path}'{suggestion(path, known)}; there are: {there}")
