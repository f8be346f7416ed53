"""The answer of a call with its derivatives."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats
from stiffmap.common.rotations import rotation_about
from stiffmap.solve.compiled import CompiledMachine
from stiffmap.solve.derivatives.prepared import INPUTS, Prepared, Requests, central
from stiffmap.solve.solution import Solution
from stiffmap.solve.solving import Call, load_types, solve_call, solve_varied

Table = dict[str, dict[str, Floats]]  # quantity -> name of the variable -> derivative


def differentiate(ready: Prepared, call: Call, requests: Requests) -> Solution:
    """Answer of the machine with all the effects of `requests`, with its derivatives; NaN where a pose failed."""
    if requests.whole or "wrench" in requests.inputs:
        call = replace(call, options=replace(call.options, stiffness=True))
    table: Table = {q: {} for q in requests.of}
    solution = (_whole if requests.whole else _displacement)(ready, call, table)
    for name in requests.inputs:
        given = (ready.base, call, solution, requests.of)
        slopes = along_wrench(*given) if name == "wrench" else along_input(*given, name)
        for variable, values in slopes:
            for q in requests.of:
                table[q][variable] = values[q]
    return solution._with_derivatives(table)


def _displacement(ready: Prepared, call: Call, table: Table) -> Solution:
    """One step of each neighbour through the factors of the base: docs/fast_path.md F10."""
    machines = [m for p in ready.parameters for m in p.machines]
    solution, varied = solve_varied(ready.base, call, machines)
    for i, p in enumerate(ready.parameters):
        ends = [varied[..., k, :] for k in (2 * i, 2 * i + 1)]
        table["displacement"][p.name] = p.stencil.combine(solution.displacement, ends)
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
    machine: CompiledMachine, call: Call, base: Solution, of: tuple[str, ...], name: str
) -> Iterator[tuple[str, dict[str, Floats]]]:
    """For each component of an input: its name, and the derivative of each quantity.

    ``position x`` per m; ``rotation rx`` per rad, the command turned about base axes. Central differences of the
    whole solution, of second order.
    """
    for i, component in enumerate(INPUTS[name]):
        stencil = central(_step(machine, name))
        ends = [solve_call(machine, _moved(machine, call, name, i, h))[0] for h in stencil.offsets]
        values = {q: stencil.combine(getattr(base, q), [getattr(s, q) for s in ends]) for q in of}
        yield f"{name} {component}", values


def _step(machine: CompiledMachine, name: str) -> float:
    return float(POSE_STEP * (machine.length if name == "position" else 1.0))


def _moved(machine: CompiledMachine, call: Call, name: str, i: int, h: float) -> Call:
    if name == "position":
        return replace(call, position=np.asarray(call.position, dtype=float) + h * np.eye(3)[i])
    now = call.options.rotation
    given = machine.home_rotation if now is None else np.asarray(now, dtype=float)
    turn = np.array(rotation_about(np.eye(3)[i], h))
    return replace(call, options=replace(call.options, rotation=turn @ given))


SHARE = 1e-5
"""Of the machine's length: what the step of a load moves the point by where stiffness is differentiated."""
SMALL = 1e-3
"""rad, below which the inverse left Jacobian is a series."""


def along_wrench(
    machine: CompiledMachine, call: Call, base: Solution, of: tuple[str, ...]
) -> Iterator[tuple[str, dict[str, Floats]]]:
    """For each component: its name, and the derivative of each quantity per N or N·m; other wrenches as they are.

    The displacement's is exact: `compliance` times what a unit of the wrench has become where the body stands
    (theory E6), its turn as a rate of the rotation vector (theory R3). Those of stiffness and compliance are central
    differences of fourth order.
    """
    slope = displacement_by_wrench(call, base)
    for i, component in enumerate(INPUTS["wrench"]):
        values = {"displacement": slope[..., i]}
        wanted = [q for q in of if q != "displacement"]
        if wanted:
            h = steps(machine, base)[..., i]
            wrench = np.zeros(6) if call.wrench is None else np.asarray(call.wrench, dtype=float)
            moved = [wrench + (k * h)[..., None] * np.eye(6)[i] for k in (1, -1, 2, -2)]
            ends = [solve_call(machine, replace(call, wrench=w))[0] for w in moved]
            for q in wanted:
                a, b, c, d = (getattr(s, q) for s in ends)
                values[q] = (8 * (a - b) - (c - d)) / (12 * h[..., None, None])
        yield f"wrench {component}", {q: values[q] for q in of}


def displacement_by_wrench(call: Call, base: Solution) -> Floats:
    """(..., 6, 6) per N and N·m."""
    o = call.options
    phi = base.displacement[..., 3:]
    slope = base.compliance @ _applied(load_types(o, [o.point, *o.wrenches])[0], phi)
    slope[..., 3:, :] = _rate_of_vector(phi) @ slope[..., 3:, :]
    return np.asarray(slope)


def _applied(load_type: str, phi: Floats) -> Floats:
    """(..., 6, 6) from the wrench as it is given to that which acts on a body turned by phi."""
    out = np.zeros((*phi.shape[:-1], 6, 6))
    out[...] = np.eye(6)
    if load_type == "dead":
        return out
    ok = np.isfinite(phi).all(axis=-1)
    r = np.full((*phi.shape, 3), np.nan)
    r[ok] = Rotation.from_rotvec(phi[ok]).as_matrix() if ok.any() else r[ok]
    if load_type == "follower":
        out[..., :3, :3] = out[..., 3:, 3:] = r
    else:
        trace = np.einsum("...ii->...", r)[..., None, None]
        out[..., 3:, 3:] = 0.5 * (trace * np.eye(3) - np.swapaxes(r, -1, -2))
    return out


def _rate_of_vector(phi: Floats) -> Floats:
    """(..., 3, 3) inverse of the left Jacobian (theory R3)."""
    t = np.linalg.norm(phi, axis=-1)[..., None, None]
    s = np.zeros((*phi.shape, 3))
    s[..., 0, 1], s[..., 0, 2], s[..., 1, 2] = -phi[..., 2], phi[..., 1], -phi[..., 0]
    s = s - np.swapaxes(s, -1, -2)
    with np.errstate(divide="ignore", invalid="ignore"):
        whole = 1 / t**2 - (1 + np.cos(t)) / (2 * t * np.sin(t))
    return np.asarray(np.eye(3) - s / 2 + np.where(t < SMALL, 1 / 12 + t**2 / 720, whole) * (s @ s))


def steps(machine: CompiledMachine, base: Solution) -> Floats:
    """(..., 6) N, N·m that move the point by `SHARE` of the length, or turn it by as many rad."""
    unit = np.array([1.0] * 3 + [machine.length] * 3)
    moved = np.sqrt(((unit[:, None] * base.compliance) ** 2).sum(axis=-2))
    return np.asarray(SHARE * machine.length / np.where(moved > 0, moved, 1 / (machine.stiffness * unit)))
