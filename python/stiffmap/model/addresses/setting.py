"""Other numbers in a machine: of its design, so that its controller knows them."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from functools import partial

from stiffmap.common.broadcasting import real_number
from stiffmap.common.errors import StiffmapError
from stiffmap.model.addresses.fields import Field, field_of, fields
from stiffmap.model.addresses.places import bar_offset, full_names, machine_fields, number_at, split
from stiffmap.model.description import Block, MachineDescription, Spring, tree

LENGTH = "length"
MOST_NAMED = 6


def with_values(description: MachineDescription, values: Mapping[str, float]) -> MachineDescription:
    """The declared machine (without effects) with numbers (SI) at these addresses, one after the other.

    StiffmapError for an address that the machine has not (it names the nearest), or a value that cannot be.
    """
    for address, value in values.items():
        number = real_number(value, address, "a finite number (SI)")
        if not math.isfinite(number):
            raise StiffmapError(f"{address}: expected a finite number (SI), got {value!r}")
        try:
            description = _with_value(description, address, number)
        except StiffmapError as problem:
            text = str(problem)
            raise StiffmapError(text if address in text else f"{address}: {text}") from None
    return description


def known_values(description: MachineDescription, address: str) -> list[float]:
    """Values (SI) of the numbers that an address stands for; StiffmapError where there are none."""
    whole = dict(machine_fields(description))
    if address in whole:
        return [whole[address].value]
    field = split(address)[1]
    found = (
        _number(description, _place(description, full, field), field) for full in _named(description, address)
    )
    return [f.value for f in found if f is not None]


def single_addresses(description: MachineDescription, address: str) -> list[str]:
    """The addresses of single elements that one address stands for; StiffmapError where there are none."""
    if address in dict(machine_fields(description)):
        return [address]
    return [f"{full}/{split(address)[1]}" for full in _named(description, address)]


def _with_value(description: MachineDescription, address: str, value: float) -> MachineDescription:
    whole = dict(machine_fields(description))
    if address in whole:
        changed_machine: MachineDescription = whole[address].put(value)
        return changed_machine
    field = split(address)[1]
    changed: set[str] = set()
    for full in _named(description, address):
        place = _place(description, full, field)
        beam = _number(description, full, f"beam.{LENGTH}") if place != full else None
        if beam is not None:
            description = beam.put(value)
        number = _number(description, place, field)
        if place not in changed and number is not None:
            description = number.put(value)
            changed.add(place)
    return description


def _place(description: MachineDescription, full: str, field: str) -> str:
    """Full name of what holds a number: of the length of a bar, the offset that it spans."""
    return (bar_offset(description, full) if field == LENGTH else None) or full


def _number(description: MachineDescription, full: str, field: str) -> Field | None:
    return number_at(description, full, partial(field_of, key=field))


def _named(description: MachineDescription, address: str) -> list[str]:
    """Full names of the elements under an address that have its field."""
    name, field = split(address)
    there = [
        full
        for full in full_names(description, name)
        if _number(description, _place(description, full, field), field) is not None
    ]
    if not there:
        raise StiffmapError(_unknown(description, address, name, field))
    return there


def _unknown(description: MachineDescription, address: str, name: str, field: str) -> str:
    """What is wrong with an address, and which are near."""
    every = every_address(description)
    names = full_names(description, name)
    if names:
        own = [a.partition("/")[2] for a in every if a.partition("/")[0] == names[0]]
        if own:
            near = difflib.get_close_matches(field, own, n=1, cutoff=0.5)
            best = f" (did you mean '{name}/{near[0]}'?)" if near else ""
            more = f" and {len(own) - MOST_NAMED} more" if len(own) > MOST_NAMED else ""
            return f"{name} has no number '{field}'{best}; it has: {', '.join(own[:MOST_NAMED])}{more}"
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
