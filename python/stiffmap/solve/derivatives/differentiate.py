"""The answer of a call with its derivatives."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.rotations import rotation_about
from stiffmap.solve.compiled import CompiledMachine
from stiffmap.solve.derivatives.by_wrench import along_wrench
from stiffmap.solve.derivatives.prepared import Prepared
from stiffmap.solve.derivatives.requests import INPUTS, Requests
from stiffmap.solve.derivatives.stencil import central, combine_all
from stiffmap.solve.solution import Solution
from stiffmap.solve.solving import Call, solve_call
from stiffmap.solve.variants import solve_varied

Table = dict[str, dict[str, Floats]]  # quantity -> name of the variable -> derivative


def differentiate(ready: Prepared, call: Call, requests: Requests) -> Solution:
    """Answer of the machine with all the effects of `requests`, with its derivatives; NaN where a pose failed."""
    if requests.whole or "wrench" in requests.inputs:
        call = replace(call, options=replace(call.options, stiffness=True))
    table: Table = {q: {} for q in requests.of}
    solution = (_whole if requests.whole else _displacement)(ready, call, table)
    for name in requests.inputs:
        if name == "wrench":
            slopes = along_wrench(ready.base, call, solution, requests.of)
        else:
            slopes = along_input(ready.base, call, solution, name, requests.of)
        for variable, values in slopes:
            for q in requests.of:
                table[q][variable] = values[q]
    return solution._with_derivatives(table)


def _displacement(ready: Prepared, call: Call, table: Table) -> Solution:
    """One step of each neighbour through the factors of the base: docs/fast_path.md F10."""
    machines = [m for p in ready.parameters for m in p.machines]
    solution, varied = solve_varied(ready.base, call, machines)
    if ready.parameters:
        slopes = combine_all([p.stencil for p in ready.parameters], solution.displacement, varied)
        for i, p in enumerate(ready.parameters):
            table["displacement"][p.name] = slopes[..., i, :]
    return solution


def _whole(ready: Prepared, call: Call, table: Table) -> Solution:
    """Every neighbour solved in full."""
    solution = solve_call(ready.base, call)[0]
    for p in ready.parameters:
        ends = [solve_call(m, call)[0] for m in p.machines]
        for q, column in table.items():
            column[p.name] = p.stencil.combine(getattr(solution, q), [_good(s, q) for s in ends])
    return solution


def _good(solution: Solution, quantity: str) -> Floats:
    values: Floats = getattr(solution, quantity)
    tail = (1,) * (values.ndim - solution.status.ndim)
    return np.where(solution.ok.reshape(solution.status.shape + tail), values, np.nan)


POSE_STEP = 1e-4  # of the machine's length, rad


def along_input(
    machine: CompiledMachine, call: Call, base: Solution, name: str, of: tuple[str, ...]
) -> Iterator[tuple[str, dict[str, Floats]]]:
    """For each component of an input: its name, and the derivative of each quantity.

    ``position x`` per m; ``rotation rx`` per rad, the command turned about base axes. Central differences of the
    whole solution, of second order.
    """
    for i, component in enumerate(INPUTS[name]):
        step = _step(machine, name)
        stencil = central(step)
        ends = [solve_call(machine, _moved(machine, call, name, i, h))[0] for h in stencil.offsets]
        yield (
            f"{name} {component}",
            {q: stencil.combine(getattr(base, q), [getattr(s, q) for s in ends]) for q in of},
        )


def _step(machine: CompiledMachine, name: str) -> float:
    return float(POSE_STEP * (machine.length if name == "position" else 1.0))


def _moved(machine: CompiledMachine, call: Call, name: str, i: int, h: float) -> Call:
    if name == "position":
        return replace(call, position=np.asarray(call.position, dtype=float) + h * np.eye(3)[i])
    now = call.options.rotation
    given = machine.home_rotation if now is None else np.asarray(now, dtype=float)
    turn = np.array(rotation_about(np.eye(3)[i], h))
    return replace(call, options=replace(call.options, rotation=turn @ given))
