"""One number of a machine as it is built moved: its controller keeps the machine that was declared."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from stiffmap.model.addresses.fields import Field, field_of, vector_fields
from stiffmap.model.addresses.places import machine_fields, number_at
from stiffmap.model.description import (
    Body,
    Element,
    Joint,
    MachineDescription,
    Offset,
    Point,
    Pose,
    Spring,
)

COUNTED = {
    Spring: ("compliance.", "stiffness."),
    Body: ("mass", "com."),
    Point: ("at.",),
    Offset: ("translation.", "actual.translation."),
}
"""Numbers that a machine as built can have otherwise, by the beginning of their names; those of joints: all but these."""
NOT_OF_JOINTS = ("home", "rest", "range.", "limits.", "compliance", "anchor.", "at.")
OUTSIDE = ("stiffness", "length")


def moved(description: MachineDescription, key: str, delta: float) -> MachineDescription | None:
    """The machine with the number ``full.name/field`` moved by `delta` (SI).

    A length of an offset moves the machine as built; the controller keeps the nominal one. None: this
    machine has no such number, or none that is an error of a machine as built (sections of a beam, angles).
    """
    found = _number(description, key)
    return None if found is None else found.put(found.value + delta)


def number(description: MachineDescription, key: str) -> float | None:
    """The number (SI) under ``full.name/field``; None as in `moved`."""
    found = _number(description, key)
    return None if found is None else found.value


def _number(description: MachineDescription, key: str) -> Field | None:
    name, _, field = key.partition("/")
    if field in OUTSIDE and name in [s.name for s in description.external_springs]:
        return dict(machine_fields(description))[key]
    return number_at(description, name, partial(_field, field=field))


def _field(element: Element, field: str) -> Field | None:
    """A number that the machine as built may have otherwise."""
    if isinstance(element, Joint):
        entry = field.startswith("compliance_slope") or not field.startswith(NOT_OF_JOINTS)
        if not entry or field.startswith("stiffness."):
            return None
    elif not field.startswith(COUNTED.get(type(element), ())):
        return None
    if isinstance(element, Offset) and field.startswith("translation."):
        if element.actual is not None:
            return None  # an error that the file states goes before
        t, r = element.nominal.translation, element.nominal.rotation
        built = vector_fields(t, "translation.", "m", lambda v: replace(element, actual=Pose(v, r)))
        return dict(built).get(field)
    return field_of(element, field)
