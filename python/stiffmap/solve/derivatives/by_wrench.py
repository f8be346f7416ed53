"""Derivatives with respect to the wrench at the point: of the displacement the compliance itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.compiled import CompiledMachine
from stiffmap.solve.derivatives.requests import INPUTS
from stiffmap.solve.solution import Solution
from stiffmap.solve.solving import Call, load_types, solve_call

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
            ends = [solve_call(machine, _moved(call, i, k * h))[0] for k in (1, -1, 2, -2)]
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


def _moved(call: Call, i: int, h: Floats) -> Call:
    given = np.zeros(6) if call.wrench is None else np.asarray(call.wrench, dtype=float)
    return replace(call, wrench=given + h[..., None] * np.eye(6)[i])
