"""Numbers of a machine by their addresses: read, listed, and changed.

An address is ``full.element.name/field`` as in uncertainties of machine files (docs/machine_files.md), or
``effects/NUMBER/parameter`` of an effect that the machine has; all values are SI.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from stiffmap.addresses import moved, number
from stiffmap.description import AppliedEffect, Joint, MachineDescription
from stiffmap.description.numbers import numbers_of
from stiffmap.description.tree import all_elements
from stiffmap.effects import apply_records
from stiffmap.errors import StiffmapError
from stiffmap.machine import Machine

DIAGONAL = tuple(f"{i}{i}" for i in range(1, 7))
SHOWN = 8
"""Addresses that a message lists."""


def addresses(description: MachineDescription) -> dict[str, float]:
    """Every address that may be changed, with its value."""
    bare = description.declared or description
    out = {}
    for name, element in all_elements(bare):
        fields = [f"{m}.{part}{d}" for m, part in (("compliance", "c"), ("stiffness", "k")) for d in DIAGONAL]
        fields += ["stiffness", "law.cubic", "mass", "com.x", "com.y", "com.z"]
        fields += [f"{t}.{a}" for t in ("translation", "at") for a in "xyz"]
        if isinstance(element, Joint):
            holders = [h for h in (element, element.drive) if h is not None]
            fields += [n.key for h in holders for n in numbers_of(h)]
        for field in dict.fromkeys(fields):
            value = number(bare, f"{name}/{field}")
            if value is not None:
                out[f"{name}/{field}"] = value
    for spring in bare.external_springs:
        out |= {f"{spring.name}/{f}": getattr(spring, f) for f in ("stiffness", "length")}
    out |= dict(_of_effects(description.effects))
    return out


def _of_effects(records: tuple[AppliedEffect, ...]) -> Iterator[tuple[str, float]]:
    for i, r in enumerate(records):
        for name, value in r.parameters:
            yield f"effects/{i}/{name}", value


def changed(machine: Machine, changes: Mapping[str, float]) -> Machine:
    """The machine with numbers changed; StiffmapError for an unknown address or an impossible machine."""
    if not changes:
        return machine
    d = machine.description
    bare = d.declared or d
    records = list(d.effects)
    for address, value in changes.items():
        head, _, rest = address.partition("/")
        if head == "effects":
            _set_effect(records, address, rest, value)
            continue
        try:
            now = number(bare, address)
            new = None if now is None else moved(bare, address, value - now)
        except (ValueError, IndexError):  # a field that is none, such as translation.q
            new = None
        if new is None:
            known = [a for a in addresses(d) if a.partition("/")[0] == head] or list(addresses(d))
            more = f" and {len(known) - SHOWN} more" if len(known) > SHOWN else ""
            raise StiffmapError(
                f"{address}: this machine has no such number; expected {', '.join(known[:SHOWN])}{more}"
            )
        bare = new
    built = apply_records(replace(bare, effects=(), declared=None), tuple(records)) if records else bare
    return Machine(built, like=machine)


def _set_effect(records: list[AppliedEffect], address: str, rest: str, value: float) -> None:
    index, _, name = rest.partition("/")
    known = dict(_of_effects(tuple(records)))
    if address not in known:
        raise StiffmapError(
            f"{address}: expected {', '.join(known) or 'no address of effects: there are none'}"
        )
    r = records[int(index)]
    records[int(index)] = replace(
        r, parameters=tuple((n, value if n == name else v) for n, v in r.parameters)
    )


def unit_of(address: str) -> str:
    """Unit (SI) of an address, as far as its name says it; empty where it does not."""
    field = address.partition("/")[2]
    if field.startswith("compliance.c"):
        return "m/N" if field[-1] in "123" else "rad/(N·m)"
    if field.startswith("stiffness.k"):
        return "N/m" if field[-1] in "123" else "N·m/rad"
    if field.startswith(("translation.", "at.", "com.")) or field == "length":
        return "m"
    return {"mass": "kg"}.get(field, "SI")
