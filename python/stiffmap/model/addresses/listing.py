"""All numbers of a machine, in the order of its file."""

from __future__ import annotations

from typing import NamedTuple

from stiffmap.model.addresses.fields import Field
from stiffmap.model.addresses.places import all_fields
from stiffmap.model.description import MachineDescription


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
    uncertainty, notes, sources = (
        dict(description.uncertainty),
        dict(description.notes),
        dict(description.sources),
    )

    def row(address: str, field: Field) -> Listed:
        name = address.partition("/")[0]
        source, note = (known.get(address, known.get(name, "")) for known in (sources, notes))
        return Listed(address, float(field.value), field.unit, uncertainty.get(address), source, note)

    return [row(address, field) for address, field in all_fields(description) if field.listed]
