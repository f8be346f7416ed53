"""A small sound machine file, and variations of it for the tests."""

from __future__ import annotations

import copy
from typing import Any

from stiffmap.common.yaml_text import parse, text_of
from stiffmap.model.description import MachineDescription
from stiffmap.model.files import description_from_text

BASE = """
name: small
units: {length: mm, force: N, angle: deg, mass: kg}
legs:
  a:
    elements:
      - {actuator: drive, kind: prismatic, axis: x, compliance: 1.0e-4}
      - {spring: foot, compliance: [1e-5, 1e-5, 1e-5, 1e-9, 1e-9, 1e-9]}
      - {joint: pin, kind: revolute, axis: z, home: 90}
      - {offset: length, translation: [0, -775, 0]}
home: {translation: [775, 0, 0], turns: [{about: z, by: 90}]}
"""
ELEMENTS = ("legs", "a", "elements")


def changed(*changes: tuple[tuple[str | int, ...], Any]) -> str:
    """The small file with values set at key paths (``...`` removes the key)."""
    data = copy.deepcopy(parse(BASE).data)
    for path, value in changes:
        node = data
        for key in path[:-1]:
            node = node[key]
        if value is ...:
            del node[path[-1]]
        elif isinstance(node, list) and path[-1] == len(node):
            node.append(value)
        else:
            node[path[-1]] = value
    return text_of(data)


def with_element(element: dict[str, Any]) -> str:
    """The small file with one more element at the end of its leg."""
    return changed(((*ELEMENTS, 4), element))


def built(element: dict[str, Any]) -> Any:
    """That element as the description has it."""
    return description(with_element(element)).legs[0].elements[-1]


def description(text: str) -> MachineDescription:
    """Description of a text."""
    return description_from_text(text, "small.yaml")
