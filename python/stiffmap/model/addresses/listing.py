"""All numbers of a machine, in the order of its file."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from stiffmap.model.addresses.fields import fields
from stiffmap.model.addresses.places import machine_fields
from stiffmap.model.description import Block, MachineDescription, tree


class Listed(NamedTuple):
    """A number (SI): its address, value and unit; its standard uncertainty, where it comes from, and what is said of it."""

    address: str
    value: float
    unit: str
    u: float | None
    source: str
    note: str


def listed(description: MachineDescription) -> list[Listed]:
    """Every number under the address by which files keep its uncertainty."""
    uncertainty, notes = dict(description.uncertainty), dict(description.notes)
    sources = dict(getattr(description, "sources", ()))
    rows = []
    for address, value, unit in _plain(description):
        name = address.partition("/")[0]
        rows.append(
            Listed(
                address,
                float(value),
                unit,
                uncertainty.get(address),
                str(sources.get(address, sources.get(name, ""))),
                notes.get(address, notes.get(name, "")),
            )
        )
    return rows


def _plain(description: MachineDescription) -> Iterator[tuple[str, float, str]]:
    for address, field in machine_fields(description):
        yield address, field.value, field.unit
    for full, element in tree.all_elements(description):
        if not isinstance(element, Block):
            for key, field in fields(element).items():
                if field.listed:
                    yield f"{full}/{key}", field.value, field.unit
