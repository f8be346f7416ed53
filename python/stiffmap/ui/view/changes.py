"""Numbers of a machine by their addresses, and numbers of its effects: read, listed, and changed.

An address is one of `Machine.numbers`, or ``effects/NUMBER/parameter`` of an effect that the machine has; all values are
SI.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from stiffmap.common.errors import StiffmapError
from stiffmap.model.addresses import listed
from stiffmap.model.description import AppliedEffect, MachineDescription
from stiffmap.model.effects import apply_records
from stiffmap.solve.machine import Machine

EFFECTS = "effects"


def addresses(description: MachineDescription) -> dict[str, float]:
    """Every address that may be changed, with its value."""
    own = {n.address: n.value for n in listed(description.declared or description)}
    return own | _of_effects(description.effects)


def _of_effects(records: tuple[AppliedEffect, ...]) -> dict[str, float]:
    return {f"{EFFECTS}/{i}/{name}": value for i, r in enumerate(records) for name, value in r.parameters}


def changed(machine: Machine, changes: Mapping[str, float]) -> Machine:
    """The machine with numbers changed; StiffmapError for an unknown address or an impossible machine."""
    own = {a: v for a, v in changes.items() if a.partition("/")[0] != EFFECTS}
    of_effects = {a: v for a, v in changes.items() if a not in own}
    if own:
        machine = machine.with_numbers(own)
    return _with_effects(machine, of_effects) if of_effects else machine


def _with_effects(machine: Machine, changes: Mapping[str, float]) -> Machine:
    d = machine.description
    values = _of_effects(d.effects)
    for address in changes:
        if address not in values:
            known = ", ".join(values) or "no address of effects: there are none"
            raise StiffmapError(f"{address}: expected {known}")
    values |= changes
    records = tuple(
        replace(r, parameters=tuple((n, values[f"{EFFECTS}/{i}/{n}"]) for n, _ in r.parameters))
        for i, r in enumerate(d.effects)
    )
    bare = replace(d.declared or d, effects=(), declared=None)
    return Machine(apply_records(bare, records), like=machine)
