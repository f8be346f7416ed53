"""What an address stands for: elements, a spring outside the legs, or the machine itself.

``x.bar/length`` is a number of one element, ``bar/length`` of the elements of that name in all legs. Names of branches may
be left out: ``x.bar`` then stands for the bars of both sides of a parallelogram.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from stiffmap.common.errors import StiffmapError
from stiffmap.model.addresses.fields import Field, declared, fields, vector_fields
from stiffmap.model.description import Block, Element, MachineDescription, Spring, tree
from stiffmap.model.description.machine import GRAVITY_LIMIT
from stiffmap.model.description.numbers import DeclaredNumber, with_entry
from stiffmap.model.description.tree import of_same_sequence


def split(address: str) -> tuple[str, str]:
    """Name and field; StiffmapError where there is no slash between them."""
    name, slash, field = address.partition("/") if isinstance(address, str) else ("", "", "")
    if not (name and slash and field):
        raise StiffmapError(f"expected the address of a number, such as 'x.bar/length', got {address!r}")
    return name, field


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
    uncertainty = dict(description.uncertainty)
    notes, sources = dict(description.notes), dict(description.sources)

    def row(address: str, field: Field) -> Listed:
        name = address.partition("/")[0]
        source, note = (known.get(address, known.get(name, "")) for known in (sources, notes))
        return Listed(address, float(field.value), field.unit, uncertainty.get(address), source, note)

    every = [*machine_fields(description)]
    for full, element in tree.all_elements(description):
        every += [(f"{full}/{key}", field) for key, field in fields(element).items()]
    return [row(address, field) for address, field in every if field.listed]


def number_at(
    description: MachineDescription, full: str, of: Callable[[Element], Field | None]
) -> Field | None:
    """A number of the elements of a full name; what its `Field.put` makes is a description. None: they have none."""
    found = next((f for f in map(of, tree.find(description, full)) if f is not None), None)

    def put(value: float) -> MachineDescription | None:
        def change(element: Element) -> Element | None:
            own = of(element)
            return None if own is None else own.put(value)

        return tree.edit(description, full, change)

    return None if found is None else found._replace(put=put)


def full_names(description: MachineDescription, name: str) -> list[str]:
    """Full names of the elements that a name stands for, each once; none: there is no such element."""
    every = list(
        dict.fromkeys(full for full, e in tree.all_elements(description) if not isinstance(e, Block))
    )
    if name in every:
        return [name]
    parts = name.removeprefix("*.").split(".")
    chains = [*tree.ENDS, *(leg.name for leg in description.legs)]
    legs = [parts[0]] if len(parts) > 1 and parts[0] in chains else chains
    rest = parts[1:] if len(parts) > 1 and parts[0] in chains else parts
    return [full for full in every if _stands_for(full.split("."), legs, rest)]


def _stands_for(full: list[str], legs: list[str], rest: list[str]) -> bool:
    """Whether leg and element agree, and the branches that are named are there in this order."""
    if full[0] not in legs or full[-1] != rest[-1]:
        return False
    branches = iter(full[1:-1])
    return all(part in branches for part in rest[:-1])


def machine_fields(d: MachineDescription) -> Iterator[tuple[str, Field]]:
    """Numbers of the machine itself, by whole addresses; what `Field.put` makes is a description."""
    yield from vector_fields(
        d.home.translation,
        "home/translation.",
        "m",
        lambda t: replace(d, home=replace(d.home, translation=t)),
    )
    if d.gravity is not None:
        for key, number in vector_fields(d.gravity, "gravity/", "m/s²", lambda g: replace(d, gravity=g)):
            yield key, number._replace(bounds=DeclaredNumber("", lower=-GRAVITY_LIMIT, upper=GRAVITY_LIMIT))
    if d.workspace is not None:
        low, high = d.workspace
        lows = vector_fields(low, "workspace/", "m", lambda v: replace(d, workspace=(v, high)))
        highs = vector_fields(high, "workspace/", "m", lambda v: replace(d, workspace=(low, v)))
        for (axis, least), (_, most) in zip(lows, highs, strict=True):
            yield from ((f"{axis}.low", least), (f"{axis}.high", most))
    for i, spring in enumerate(d.external_springs):
        numbers = declared(spring)
        for key, number in sorted(numbers.items(), key=lambda item: item[0].startswith("anchor")):
            yield f"{spring.name}/{key}", number.inside(partial(with_entry, d, "external_springs", i))


def bar_offset(d: MachineDescription, full: str) -> str | None:
    """Full name of the offset that is the length of the link of a spring: the one before it; None: there is none, or it is
    not as long as the beam from which the spring was computed."""
    around, _, name = full.rpartition(".")
    sequence = [e for other, e in tree.all_elements(d) if other.rpartition(".")[0] == around]
    k = next((i for i, e in enumerate(sequence) if isinstance(e, Spring) and e.name == name), 0)
    i = tree.offset_before(sequence, k)
    if i is None:
        return None
    before, spring = sequence[i], sequence[k]
    if isinstance(spring, Spring) and spring.beam is not None:
        length = dict(spring.beam.numbers)["length"]
        if abs(fields(before)["length"].value - length) > 1e-9 * length:
            return None
    return of_same_sequence(full, before.name)
