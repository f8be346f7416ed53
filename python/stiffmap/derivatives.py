"""Derivatives of the displacement with respect to effect parameters, by implicit differentiation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from stiffmap.broadcasting import Floats
from stiffmap.description import MachineDescription
from stiffmap.errors import StiffmapError
from stiffmap.solution import Solution
from stiffmap.solving import Call
from stiffmap.variants import solve_varied

if TYPE_CHECKING:
    from stiffmap.machine import Machine

Request = tuple[str, Mapping[str, Any]]
STEP = 2e-3  # of a typical scale: truncation and round-off are both below 1e-7 there


@dataclass(frozen=True)
class Variation:
    """One parameter: its name and the descriptions with it moved by `offsets` times `step`.

    ``weights`` turn the displacements of base (first) and variants into the derivative.
    """

    name: str
    descriptions: tuple[MachineDescription, ...]
    weights: tuple[float, ...]


@dataclass(frozen=True)
class Prepared:
    """A machine with every requested effect, and the machines with one parameter moved."""

    base: Machine
    variations: tuple[Variation, ...]
    moved: tuple[Machine, ...]


def differentiate(machine: Machine, call: Call, requests: Sequence[Request]) -> Solution:
    """Answer of the machine with all the effects of `requests`, with its derivatives."""
    ready = machine._prepared(requests)
    solution, varied = solve_varied(ready.base, call, ready.moved)
    out, i = {}, 0
    for v in ready.variations:
        n = len(v.descriptions)
        out[v.name] = combine(v, solution.displacement, varied[..., i : i + n, :])
        i += n
    return solution._with_derivatives(out)


def prepare(machine: Machine, requests: Sequence[Request]) -> Prepared:
    """Compiles what the derivatives need; independent of poses and loads."""
    base, variations = base_and_variations(machine.description, requests)
    make = type(machine)
    moved = tuple(make(d) for v in variations for d in v.descriptions)
    return Prepared(make(base), tuple(variations), moved)


def request_key(requests: Sequence[Request]) -> str:
    """Equal for equal requests."""
    return repr([(r[0], sorted(r[1].items())) if _well_formed(r) else r for r in requests])


def _well_formed(request: Any) -> bool:
    return len(request) == 2 and isinstance(request[1], Mapping)


def base_and_variations(
    description: MachineDescription, requests: Sequence[Request]
) -> tuple[MachineDescription, list[Variation]]:
    """The machine with every requested effect, and each of its parameters moved.

    A request is ``(kind, {"element": ..., "legs": [...], parameter: value, ...})``; the derivative is
    taken with respect to every number in it, at that number.
    """
    from stiffmap.effects import get

    for request in requests:
        if not _well_formed(request):
            raise StiffmapError(f"derivatives: expected (kind, {{parameter: value, ...}}), got {request!r}")
    base = _with_all(description, requests)
    out = []
    for i, (kind, arguments) in enumerate(requests):
        effect = get(kind)
        for parameter in effect.parameters:
            if parameter.name not in arguments:
                continue
            value = float(arguments[parameter.name])

            def at(v: float, i: int = i, name: str = parameter.name) -> MachineDescription:
                changed = list(requests)
                changed[i] = (changed[i][0], {**changed[i][1], name: v})
                return _with_all(description, changed)

            name = _name(kind, arguments, parameter.name)
            out.append(_vary(name, at, value, STEP * parameter.scale, parameter.lower, parameter.upper))
    return base, out


def _with_all(description: MachineDescription, requests: Sequence[Request]) -> MachineDescription:
    from stiffmap.effects import add_effect

    for kind, arguments in requests:
        description = add_effect(description, kind, **dict(arguments))
    return description


def _name(kind: str, arguments: Mapping[str, Any], parameter: str) -> str:
    place = [str(arguments[k]) for k in ("element",) if arguments.get(k)]
    legs = ",".join(arguments.get("legs") or ())
    return " ".join([kind, *place, *([legs] if legs else []), parameter])


def _vary(
    name: str,
    at: Callable[[float], MachineDescription],
    value: float,
    step: float,
    lower: float,
    upper: float,
) -> Variation:
    """Central differences; second-order one-sided ones next to a bound."""
    if value - step >= lower and value + step <= upper:
        return Variation(name, (at(value - step), at(value + step)), (0.0, -0.5 / step, 0.5 / step))
    side = 1.0 if value - step < lower else -1.0
    h = side * step
    return Variation(name, (at(value + h), at(value + 2 * h)), (-1.5 / h, 2.0 / h, -0.5 / h))


def combine(variation: Variation, base: Floats, variants: Floats) -> Floats:
    """(..., 6) derivative from displacements (..., 6) and (..., variants, 6)."""
    w = variation.weights
    return np.asarray(w[0] * base + np.tensordot(variants, np.array(w[1:]), axes=([-2], [0])))
