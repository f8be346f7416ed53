"""The compiled machines that derivatives with respect to effect parameters need."""

from __future__ import annotations

from dataclasses import dataclass

from stiffmap.model.effects import get
from stiffmap.solve.compiled import CompiledMachine
from stiffmap.solve.derivatives.neighbours import Neighbours
from stiffmap.solve.derivatives.requests import Requests, parameter_name
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
