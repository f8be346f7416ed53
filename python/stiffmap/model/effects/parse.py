"""Effects as one line of text, as a command line takes them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress

from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import read_value
from stiffmap.model.description import AppliedEffect, MachineDescription
from stiffmap.model.effects import registry
from stiffmap.model.effects.apply import place_of
from stiffmap.model.effects.types import EffectType

_FORM = "KIND [ELEMENT [LEG,LEG…]] name=value… such as: dead_zone actuator y half_width=12um"


def parse_effect(text: str, machine: MachineDescription | None = None) -> AppliedEffect:
    """Effect from a text such as ``dead_zone actuator y half_width=12um``.

    After the kind come the element and the legs (``x,y``; left out or ``all``: all that have the
    element), then the parameters, each number with its unit, and the options. The record goes to
    `apply_records`, which checks it against the machine. Raises StiffmapError for what it cannot
    read, an unknown kind or parameter, and a number without unit or with a wrong one. With a `machine`
    also for a length where something turns, and for an element or leg that it does not have.
    """
    words = re.sub(r"\s*=\s*", "=", text).split()
    if not words:
        raise StiffmapError(f"empty effect; expected {_FORM}")
    # a unit may stand apart from its number
    before, *assignments = re.split(r"\s(?=\S*=)", " ".join(words))
    kind, *place = before.split()
    effect = registry.get(kind)
    if len(place) > 2:
        raise StiffmapError(f"{text!r}: cannot read {' '.join(place[2:])!r}; expected {_FORM}")
    element = place[0] if place else ""
    legs = tuple(place[1].split(",")) if len(place) == 2 and place[1] != "all" else ()
    units = _units(effect, machine, element, legs)
    numbers, options = _read(effect, units, assignments)
    return AppliedEffect(effect.kind, element, legs, numbers, options)


def _units(
    effect: EffectType, machine: MachineDescription | None, element: str, legs: tuple[str, ...]
) -> dict[str, tuple[str, ...]]:
    """The units that each parameter may have; at a known place one only."""
    if machine is None:
        return {p.name: (p.unit, p.angular) if p.angular else (p.unit,) for p in effect.parameters}
    declared = machine.declared or machine
    at = place_of(effect, declared, element or None, legs or None)
    return {p.name: (p.unit,) for p in effect.parameters_at(declared, *at)}


def _read(
    effect: EffectType, units: Mapping[str, tuple[str, ...]], assignments: Sequence[str]
) -> tuple[tuple[tuple[str, float], ...], tuple[tuple[str, str], ...]]:
    options = {o.name for o in effect.options}
    numbers: dict[str, float] = {}
    words: dict[str, str] = {}
    for assignment in assignments:
        name, _, value = assignment.partition("=")
        if name in numbers or name in words:
            raise StiffmapError(f"{effect.kind}: {name} is given twice")
        if name in options:
            words[name] = value
        elif name in units:
            numbers[name] = _value(effect, name, value, units[name])
        else:
            there = ", ".join([*units, *sorted(options)])
            raise StiffmapError(f"{effect.kind}: unknown parameter {name!r}; known: {there}")
    return tuple(numbers.items()), tuple(words.items())


def _value(effect: EffectType, name: str, text: str, units: Sequence[str]) -> float:
    """The value in the unit of the parameter, or in the angular one of what turns."""
    for unit in units[1:]:
        with suppress(StiffmapError):
            return read_value(text, unit)
    try:
        return read_value(text, units[0])
    except StiffmapError as problem:
        raise StiffmapError(f"{effect.kind}: {name}: {problem}") from None


def effect_text(record: AppliedEffect, machine: MachineDescription | None = None) -> str:
    """The text that `parse_effect` reads as this record, in SI units (without a machine, of what slides)."""
    effect = registry.get(record.kind)
    units = _units(effect, machine, record.element, record.legs)
    place = [record.element] if record.element else []
    place += [",".join(record.legs)] if record.legs else []
    after = {n: "" if known[0] == "1" else f" {known[0]}" for n, known in units.items()}
    numbers = [f"{n}={v!r}{after[n]}" for n, v in record.parameters]
    return " ".join([record.kind, *place, *numbers, *(f"{n}={w}" for n, w in record.options)])
