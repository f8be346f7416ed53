"""What derivatives a call asks for, the compiled machines that those by effect parameters need, and the differences between them:
of second order, central, one-sided next to a bound."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stiffmap.common.broadcasting import Floats, names_of, one_of, refused
from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import TASK, AppliedEffect, MachineDescription
from stiffmap.model.effects import add_effect, apply_records, get
from stiffmap.solve.compiled import CompiledMachine
from stiffmap.solve.labels import WRENCH

EffectRequest = tuple[str, Mapping[str, Any]]
Request = EffectRequest | str

INPUTS = {"position": TASK[:3], "rotation": TASK[3:], "wrench": WRENCH}
DISPLACEMENT = ("displacement",)
QUANTITIES = ("displacement", "stiffness", "compliance")


@dataclass(frozen=True)
class Requests:
    """Effects whose numbers are varied, inputs of the call that are, and what is differentiated."""

    effects: tuple[EffectRequest, ...]
    inputs: tuple[str, ...]
    of: tuple[str, ...]

    @property
    def whole(self) -> bool:
        """Stiffness or compliance is wanted, so that varied machines are solved in full."""
        return self.of != DISPLACEMENT

    @property
    def key(self) -> str:
        """Equal for the same machines."""
        return repr((self.whole, [(kind, sorted(a.items())) for kind, a in self.effects]))


def read_requests(given: Sequence[Request], of: Sequence[str]) -> Requests:
    """Checked requests; StiffmapError for one of another form."""
    of = names_of(of, "derivatives_of")
    for name in of:
        one_of(name, QUANTITIES, "derivatives_of")
    if not given and of != DISPLACEMENT:
        raise refused("derivatives_of", "derivatives as well, by which these are", "none")
    effects, inputs = [], []
    for request in given:
        if isinstance(request, str):
            if request not in INPUTS:
                raise StiffmapError(
                    f"derivatives: expected an effect or one of {', '.join(INPUTS)}, got {request!r}"
                )
            inputs.append(request)
        else:
            effects.append(_effect(request))
    return Requests(tuple(effects), tuple(dict.fromkeys(inputs)), tuple(dict.fromkeys(of)))


def _effect(request: Any) -> EffectRequest:
    pair = isinstance(request, (tuple, list)) and len(request) == 2
    if not pair or not isinstance(request[0], str) or not isinstance(request[1], Mapping):
        raise StiffmapError(f"derivatives: expected (kind, {{parameter: value, ...}}), got {request!r}")
    return request[0], dict(request[1])


def parameter_name(request: EffectRequest, parameter: str) -> str:
    """``length bar x error``: kind, element and legs as they were given, parameter."""
    kind, arguments = request
    element = arguments.get("element")
    legs = ",".join(arguments.get("legs") or ())
    return " ".join([kind, *([str(element)] if element else []), *([legs] if legs else []), parameter])


# Of a parameter's typical scale. Truncation of a displacement is below 1e-7 at the small step; the larger one keeps
# the last digits of a stiffness below its change (docs/effects.md).
STEP, WHOLE_STEP = 2e-3, 0.03


@dataclass(frozen=True)
class Stencil:
    """Derivative = sum of ``weights[1:]`` times the values at ``offsets``, and ``weights[0]`` times the base's."""

    offsets: tuple[float, float]
    weights: tuple[float, float, float]

    def combine(self, base: Floats, values: Sequence[Floats]) -> Floats:
        """The derivative from the base's value and those at the offsets, all (...)."""
        w = self.weights
        moved = w[1] * values[0] + w[2] * values[1]
        return np.asarray(moved if w[0] == 0 else moved + w[0] * base)


def central(step: float) -> Stencil:
    """Error step²/6 times the third derivative."""
    return Stencil((-step, step), (0.0, -0.5 / step, 0.5 / step))


def within(value: float, step: float, lower: float, upper: float) -> Stencil:
    """Central where both sides are inside the bounds, else one-sided with error step²/3 times the third."""
    if value - step >= lower and value + step <= upper:
        return central(step)
    h = step if value - step < lower else -step
    return Stencil((h, 2 * h), (-1.5 / h, 2.0 / h, -0.5 / h))


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
