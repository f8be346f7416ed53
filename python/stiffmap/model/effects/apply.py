"""Adding effects to a machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import AppliedEffect, MachineDescription
from stiffmap.model.effects import registry
from stiffmap.model.effects.check import check_exclusion, place_of, split, values_at
from stiffmap.model.effects.types import EffectType, Placed


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
