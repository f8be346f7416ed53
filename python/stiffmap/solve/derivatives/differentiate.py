"""The answer of a call with its derivatives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.derivatives.by_wrench import along_wrench
from stiffmap.solve.derivatives.inputs import along_input
from stiffmap.solve.derivatives.prepared import Prepared
from stiffmap.solve.derivatives.requests import Requests
from stiffmap.solve.derivatives.stencil import combine_all
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
