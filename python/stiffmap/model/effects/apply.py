"""Adding effects to a machine, and checking what the user asks for against the registry and the machine."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from stiffmap.common.broadcasting import names_of
from stiffmap.common.errors import StiffmapError, suggestion
from stiffmap.common.kept import Kept
from stiffmap.model.description import AppliedEffect, MachineDescription
from stiffmap.model.effects import registry
from stiffmap.model.effects.types import EffectType, Parameter, Place, Placed, same_part


def add_effect(
    description: MachineDescription,
    kind: str,
    *,
    element: str | None = None,
    legs: Sequence[str] | None = None,
    **parameters: object,
) -> MachineDescription:
    """The machine with one more effect; the order in which effects are added does not matter.

    Parameters
    ----------
    kind
        One of `stiffmap.model.effects.library()`; docs/effects.md describes them all.
    element
        Name of the element in the machine file (``actuator``, ``bar`` …), or ``machine``, ``base``,
        ``platform``; may be left out where only one is possible.
    legs
        Names of the legs, or the name of one; left out: all that have the element.
    parameters
        In SI units, and options in words.

    Raises
    ------
    StiffmapError
        For an unknown kind, element, leg or parameter, a value out of its bounds, a missing one, and
        effects that exclude each other.
    """
    if description.effects and description.declared is None:
        raise StiffmapError(f"{description.name}: has effects, but not the machine before them (`declared`)")
    declared = description.declared or description
    record = _checked(declared, description.effects, kind, element, legs, parameters)
    resolve(registry.get(kind), declared, record)
    records = (*description.effects, record)
    stages = [registry.get(r.kind).stage for r in records]
    if stages[-1] == max(stages):
        return replace(_apply(description, declared, record), effects=records, declared=declared)
    if description != _build(declared, description.effects):
        raise StiffmapError(
            f"{description.name}: was changed by other means after effects were added to it; "
            f"add {record.kind} before, or make the change in the declared machine"
        )
    return _build(declared, records)


def apply_records(description: MachineDescription, records: Sequence[AppliedEffect]) -> MachineDescription:
    """The machine with the effects of these records added one after the other."""
    at_once = not description.effects and description.declared is None
    checked: list[AppliedEffect] = []
    for r in records:
        place, given = (r.element or None, r.legs or None), {**dict(r.parameters), **dict(r.options)}
        if at_once:  # one build of them all
            checked.append(_checked(description, checked, r.kind, *place, given))
        else:
            description = add_effect(description, r.kind, element=place[0], legs=place[1], **given)
    return _build(description, tuple(checked)) if checked else description


def _checked(
    declared: MachineDescription,
    beside: Sequence[AppliedEffect],
    kind: str,
    element: str | None,
    legs: Sequence[str] | None,
    parameters: Mapping[str, object],
) -> AppliedEffect:
    """The record of one more effect next to others; StiffmapError for what cannot be."""
    effect = registry.get(kind)
    if effect.measurement:
        raise StiffmapError(
            f"{kind}: lives in the measurement, not in the machine; a diagnosis applies it to readings"
        )
    numbers, options = split(effect, parameters)
    place = place_of(effect, declared, element, legs)
    record = AppliedEffect(kind, *place, parameters=numbers, options=options)
    check_exclusion(record, beside)
    return record


def resolve(effect: EffectType, declared: MachineDescription, record: AppliedEffect) -> Placed:
    """An effect record with every value and option filled in; StiffmapError for a bad one."""
    values = values_at(effect, declared, record)
    options = {o.name: o.choices[0] for o in effect.options} | dict(record.options)
    return Placed(record.kind, record.element, record.legs, values, options)


def _build(declared: MachineDescription, records: tuple[AppliedEffect, ...]) -> MachineDescription:
    built = declared
    for r in sorted(records, key=lambda r: registry.get(r.kind).stage):
        built = _apply(built, declared, r)
    return replace(built, effects=records, declared=declared)


def _apply(built: MachineDescription, declared: MachineDescription, r: AppliedEffect) -> MachineDescription:
    effect = registry.get(r.kind)
    assert effect.apply is not None  # measurement effects are refused before
    try:
        return effect.apply(built, resolve(effect, declared, r))
    except StiffmapError as problem:
        raise StiffmapError(f"{place_text(r)}: {problem}") from None


def place_text(r: AppliedEffect) -> str:
    """``dead_zone of actuator, leg y``."""
    legs = f", leg{'s' if len(r.legs) > 1 else ''} {', '.join(r.legs)}" if r.legs else ""
    return f"{r.kind} of {r.element}{legs}"


Numbers = tuple[tuple[str, float], ...]
Words = tuple[tuple[str, str], ...]


def split(effect: EffectType, given: Mapping[str, object]) -> tuple[Numbers, Words]:
    """Parameters and options by their kinds, in the order of the registry."""
    known = [p.name for p in effect.parameters] + [o.name for o in effect.options]
    for name in given:
        if name not in known:
            hint = suggestion(name, known)
            raise StiffmapError(f"{effect.kind}: unknown parameter {name!r}{hint}; known: {', '.join(known)}")
    numbers = tuple((p.name, _number(effect, p, given[p.name])) for p in effect.parameters if p.name in given)
    words = tuple((o.name, str(given[o.name])) for o in effect.options if o.name in given)
    for option in effect.options:
        word = dict(words).get(option.name, option.choices[0])
        if word not in option.choices:
            expected = ", ".join(option.choices)
            raise StiffmapError(f"{effect.kind}: {option.name}: expected one of {expected}, got {word!r}")
    return numbers, words


def _number(effect: EffectType, p: Parameter, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if isinstance(value, (bool, str)) or not math.isfinite(number):
        raise StiffmapError(f"{effect.kind}: {p.name}: expected a finite number in {p.unit}, got {value!r}")
    return number


def place_of(
    effect: EffectType, machine: MachineDescription, element: str | None, legs: Sequence[str] | None
) -> tuple[str, tuple[str, ...]]:
    """Element and legs (in the machine's order); raises StiffmapError listing those that exist."""
    key = (id(effect), id(machine))  # both are held, so that their numbers stay theirs
    places = _PLACES.made(key, lambda: (effect, machine, effect.places(machine)))[2]
    names = list(dict.fromkeys(name for name, _ in places))
    element = _element(effect, names, element)
    having = {leg for name, at in places for leg in at if name == element}
    order = [leg.name for leg in machine.legs]
    for leg in (legs := names_of(legs or (), "legs")):
        if leg not in having:
            there = ", ".join(n for n in order if n in having) or "none"
            raise StiffmapError(f"{effect.kind} of {element}: no leg {leg!r} has it; legs that do: {there}")
    wanted = set(legs or having)
    return element, tuple(n for n in order if n in wanted)


_PLACES = Kept[tuple[int, int], tuple[EffectType, MachineDescription, list[Place]]](256)
"""Where a machine may have an effect, for the last few: fits add the same effects again and again."""


def _element(effect: EffectType, names: list[str], element: str | None) -> str:
    there = ", ".join(names)
    if not names:
        raise StiffmapError(f"{effect.kind}: this machine has no element that it could act on")
    if element is None:
        if len(names) > 1:
            raise StiffmapError(f"{effect.kind}: say on which element; there are: {there}")
        return names[0]
    if element not in names:
        hint = suggestion(element, names)
        raise StiffmapError(
            f"{effect.kind}: no element {element!r} that it can act on{hint}; there are: {there}"
        )
    return element


def values_at(effect: EffectType, machine: MachineDescription, record: AppliedEffect) -> dict[str, float]:
    """All values of a record, defaults filled in; raises StiffmapError for missing or out of bounds."""
    given = dict(record.parameters)
    if effect.one_of and sum(n in given for n in effect.one_of) != 1:
        raise StiffmapError(f"{effect.kind}: give exactly one of {', '.join(effect.one_of)}")
    if effect.vector and not any(n in given for n in effect.vector):
        raise StiffmapError(f"{effect.kind}: give at least one of {', '.join(effect.vector)}")
    values = {}
    for p in effect.parameters_at(machine, record.element, record.legs):
        default = p.null if p.name in effect.vector else p.default
        if p.name not in given and default is None:
            if p.name in effect.one_of:
                continue
            raise StiffmapError(f"{effect.kind}: {p.name} is missing ({p.unit}): {p.doc}")
        value = given.get(p.name, default)
        assert value is not None
        if not p.lower <= value <= p.upper:
            raise StiffmapError(
                f"{effect.kind}: {p.name}: expected {p.lower:g} to {p.upper:g} {p.unit}, got {value:g}"
            )
        values[p.name] = value
    return values


def check_exclusion(new: AppliedEffect, records: Sequence[AppliedEffect]) -> None:
    """Raises StiffmapError where an effect added before excludes the new one."""
    for old in records:
        shared = set(new.legs) & set(old.legs)
        meet = same_part(new.element, old.element) and (shared or not new.legs or not old.legs)
        if not meet:
            continue
        where = new.element + (f", leg {', '.join(sorted(shared))}" if shared else "")
        if old.kind in registry.get(new.kind).excludes or new.kind in registry.get(old.kind).excludes:
            raise StiffmapError(f"{new.kind} and {old.kind} exclude each other on {where}; remove one")
