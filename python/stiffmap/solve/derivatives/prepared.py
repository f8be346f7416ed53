"""The compiled machines that derivatives with respect to effect parameters need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from stiffmap.model.description import AppliedEffect, MachineDescription
from stiffmap.model.effects import add_effect, apply_records, get
from stiffmap.solve.compiled import CompiledMachine
from stiffmap.solve.derivatives.requests import EffectRequest, Requests, parameter_name
from stiffmap.solve.derivatives.stencil import Stencil, within

# Of a parameter's typical scale. Truncation of a displacement is below 1e-7 at the small step; the larger one keeps
# the last digits of a stiffness below its change (docs/effects.md).
STEP, WHOLE_STEP = 2e-3, 0.03


@dataclass(frozen=True)
class Moved:
    """One parameter: its name, the machines at the offsets of the stencil."""

    name: str
    stencil: Stencil
    machines: tuple[CompiledMachine, CompiledMachine]


@dataclass(frozen=True)
class Prepared:
    """A machine with every requested effect, and its neighbours; independent of poses and loads."""

    base: CompiledMachine
    parameters: tuple[Moved, ...]


def prepare(machine: CompiledMachine, requests: Requests) -> Prepared:
    """Compiles the machines; StiffmapError for effects that the machine cannot have."""
    near = Neighbours(machine.description, requests.effects)
    share = WHOLE_STEP if requests.whole else STEP
    out = []
    for i, (kind, arguments) in enumerate(requests.effects):
        for p in get(kind).parameters:
            if p.name in arguments:
                value = float(arguments[p.name])
                stencil = within(value, share * p.scale, p.lower, p.upper)
                low, high = (
                    CompiledMachine(near.moved(i, p.name, value + h), like=machine) for h in stencil.offsets
                )
                out.append(Moved(parameter_name(requests.effects[i], p.name), stencil, (low, high)))
    return Prepared(CompiledMachine(near.base, like=machine) if requests.effects else machine, tuple(out))


def with_requests(description: MachineDescription, effects: Sequence[EffectRequest]) -> MachineDescription:
    """The machine with every requested effect; StiffmapError for a bad one."""
    for kind, arguments in effects:
        description = add_effect(description, kind, **dict(arguments))
    return description


class Neighbours:
    """The machine with all requests (`base`), and its neighbours.

    An effect on legs changes these legs and nothing else, so that a neighbour's legs are built from a machine
    that has no others; the rest is the base's. An effect without legs builds the whole machine anew.
    """

    def __init__(self, description: MachineDescription, effects: Sequence[EffectRequest]) -> None:
        self._description = description
        self.base = with_requests(description, effects)
        self._first = len(description.effects)
        self._parts: dict[tuple[str, ...], MachineDescription] = {}

    def moved(self, index: int, parameter: str, value: float) -> MachineDescription:
        """The base with one number of request `index` at another value."""
        records = list(self.base.effects[self._first :])
        old = records[index]
        numbers = tuple((n, value if n == parameter else v) for n, v in old.parameters)
        records[index] = replace(old, parameters=numbers)
        if not old.legs:
            return apply_records(self._description, records)
        part = apply_records(
            self._part(old.legs), [_on(r, old.legs) for r in records if _touches(r, old.legs)]
        )
        changed = {leg.name: leg for leg in part.legs}
        legs = tuple(changed.get(leg.name, leg) for leg in self.base.legs)
        return replace(self.base, legs=legs, effects=(*self._description.effects, *records))

    def _part(self, legs: tuple[str, ...]) -> MachineDescription:
        if legs not in self._parts:
            self._parts[legs] = _only(self._description, legs)
        return self._parts[legs]


def _only(description: MachineDescription, legs: tuple[str, ...]) -> MachineDescription:
    kept = tuple(leg for leg in description.legs if leg.name in legs)
    effects = tuple(_on(r, legs) for r in description.effects if _touches(r, legs))
    declared = description.declared and _only(description.declared, legs)
    return replace(description, legs=kept, effects=effects, declared=declared)


def _touches(record: AppliedEffect, legs: tuple[str, ...]) -> bool:
    return not record.legs or bool(set(record.legs) & set(legs))


def _on(record: AppliedEffect, legs: tuple[str, ...]) -> AppliedEffect:
    return replace(record, legs=tuple(leg for leg in record.legs if leg in legs))
