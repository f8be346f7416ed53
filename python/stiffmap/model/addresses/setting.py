"""Other numbers in a machine: of its design, so that its controller knows them, or as it is built."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial

from stiffmap.common.broadcasting import instance_of, real_number
from stiffmap.common.errors import StiffmapError
from stiffmap.common.short import first_of
from stiffmap.model.addresses.fields import Field, field_of, fields, vector_fields
from stiffmap.model.addresses.places import bar_offset, full_names, machine_fields, number_at, split
from stiffmap.model.description import (
    Block,
    Body,
    Element,
    Joint,
    MachineDescription,
    Offset,
    Point,
    Pose,
    Spring,
    tree,
)

LENGTH = "length"


def with_values(description: MachineDescription, values: Mapping[str, float]) -> MachineDescription:
    """The declared machine (without effects) with numbers (SI) at these addresses, one after the other.

    StiffmapError for an address that the machine has not (it names the nearest), a bad value, or a number set twice.
    """
    for address, value in instance_of(values, Mapping, "values", "numbers by address").items():
        number = real_number(value, instance_of(address, str, "address", "text"), "a finite number (SI)")
        if not math.isfinite(number):
            raise StiffmapError(f"{address}: expected a finite number (SI), got {value!r}")
        try:
            description = _with_value(description, address, number)
        except StiffmapError as problem:
            text = str(problem)
            raise StiffmapError(text if address in text else f"{address}: {text}") from None
    for address, value in values.items() if len(values) > 1 else ():
        now = known_values(description, address)
        if not any(math.isclose(v, value, abs_tol=1e-15) for v in now):
            raise StiffmapError(f"{address}: another address sets this number to {now[0]:g}; keep one")
    for ends in [a.rpartition(".")[0] for a in values if a.endswith((".low", ".high"))]:
        low, high = (known_values(description, f"{ends}.{end}") for end in ("low", "high"))
        least, most = max(zip(low, high, strict=True), key=lambda pair: pair[0] - pair[1])
        if least >= most:
            raise StiffmapError(f"{ends}: the lower end {least:g} is not below the upper end {most:g}")
    return description


def known_values(description: MachineDescription, address: str) -> list[float]:
    """Values (SI) of the numbers that an address stands for; StiffmapError where there are none."""
    return [number.value for number in _numbers(description, address).values()]


def single_addresses(description: MachineDescription, address: str) -> list[str]:
    """The addresses of single elements that one address stands for; StiffmapError where there are none."""
    return list(_numbers(description, address))


def _numbers(description: MachineDescription, address: str) -> dict[str, Field]:
    """The numbers that an address stands for, each by its own address; StiffmapError where there are none."""
    name, field = split(address)
    names = [name] if address in dict(machine_fields(description)) else full_names(description, name)
    there = {f"{n}/{field}": _number(description, _place(description, n, field), field) for n in names}
    found = {one: number for one, number in there.items() if number is not None}
    if not found:
        raise StiffmapError(_unknown(description, address, name, field))
    return found


def _with_value(description: MachineDescription, address: str, value: float) -> MachineDescription:
    changed: set[str] = set()
    for full, field in map(split, _numbers(description, address)):
        place = _place(description, full, field)
        beam = _number(description, full, f"beam.{LENGTH}") if place != full else None
        if beam is not None:
            description = beam.put(value)
        number = _number(description, place, field)
        if place not in changed and number is not None:
            if not number.bounds.lower <= value <= number.bounds.upper:
                raise StiffmapError(f"{address}: expected {number.bounds.expected}, got {value!r}")
            description = number.put(value)
            changed.add(place)
    return description


def _place(description: MachineDescription, full: str, field: str) -> str:
    """Full name of what holds a number: of the length of a bar, the offset that it spans."""
    return (bar_offset(description, full) if field == LENGTH else None) or full


def _number(description: MachineDescription, full: str, field: str) -> Field | None:
    of_machine = dict(machine_fields(description)).get(f"{full}/{field}")
    return of_machine or number_at(description, full, partial(field_of, key=field))


def _unknown(description: MachineDescription, address: str, name: str, field: str) -> str:
    """What is wrong with an address, and which are near."""
    every = every_address(description)
    names = full_names(description, name)
    if names:
        own = [a.partition("/")[2] for a in every if a.partition("/")[0] == names[0]]
        if own:
            near = difflib.get_close_matches(field, own, n=1, cutoff=0.5)
            best = f" (did you mean '{name}/{near[0]}'?)" if near else ""
            return f"{name} has no number '{field}'{best}; it has: {first_of(own, 6)}"
        return f"{name} has no numbers of its own"
    short = [f"{a.split('.', 1)[1]}" for a in every if "." in a.partition("/")[0]]
    near = difflib.get_close_matches(address, [*every, *dict.fromkeys(short)], n=1, cutoff=0.3)
    best = f"; the nearest is '{near[0]}'" if near else ""
    return f"machine '{description.name}' has no number '{address}'{best} (machine.numbers() lists them all)"


def every_address(description: MachineDescription) -> list[str]:
    """All addresses of single numbers, also those that say a listed one in another way."""
    out = [address for address, _ in machine_fields(description)]
    for full, element in tree.all_elements(description):
        if isinstance(element, Block):
            continue
        out += [f"{full}/{key}" for key in fields(element)]
        if isinstance(element, Spring) and bar_offset(description, full) is not None:
            out.append(f"{full}/{LENGTH}")
    return out


COUNTED = {
    Spring: ("compliance.", "stiffness.", "beam."),
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
    machine has no such number, or none that is an error of a machine as built (angles).
    """
    found = _as_built(description, key)
    return None if found is None else found.put(found.value + delta)


def number(description: MachineDescription, key: str) -> float | None:
    """The number (SI) under ``full.name/field``; None as in `moved`."""
    found = _as_built(description, key)
    return None if found is None else found.value


def _as_built(description: MachineDescription, key: str) -> Field | None:
    name, _, field = key.partition("/")
    if field in OUTSIDE and name in [s.name for s in description.external_springs]:
        return dict(machine_fields(description))[key]
    return number_at(description, name, partial(_built_field, field=field))


def _built_field(element: Element, field: str) -> Field | None:
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
