"""Tensions within limits that balance a wrench: nearest to given ones, which are unique."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stiffmap.common.broadcasting import Floats, wrench_array
from stiffmap.common.errors import StiffmapError
from stiffmap.solve.machine import Machine, takes_machine
from stiffmap.workspace.cables.structure import Hanging, hanging, lines, matrix, poses, weight

MOST_STEPS = 100
BALANCED = 1e-9
"""Residual that is none, of the largest force."""


@dataclass(frozen=True, eq=False)
class TensionDistribution:
    """Tensions at poses, and whether there are any."""

    tension: Floats
    """(..., cables) N; NaN where no tensions within the limits balance the wrench."""
    feasible: NDArray[np.bool_]
    """(...)."""
    cables: tuple[str, ...]


@takes_machine
def tension_distribution(
    machine: Machine,
    position: ArrayLike,
    wrench: ArrayLike | None = None,
    *,
    rotation: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    lowest: ArrayLike = 0.0,
    highest: ArrayLike | None = None,
    near: ArrayLike | None = None,
) -> TensionDistribution:
    """Tensions that hold the platform at commanded poses against its weight and a wrench at the tcp, forces commanded.

    position (..., 3) m, wrench (..., 6) N and N·m, rotation (..., 3, 3); gravity (3,) m/s², None: the machine file's.
    Of all tensions between `lowest` and `highest` (N, one or one per cable; None: what the machine file allows) those
    nearest to `near` (N) in the sum of squares, None: the lowest ones. Machines without legs; StiffmapError otherwise.
    What lengths are commanded instead, `Machine.solve` says which tensions follow from compliance.
    """
    h = hanging(machine)
    p, r = poses(machine, position, rotation)
    low, high = limits(h, lowest, highest)
    aim = low if near is None else _per_cable(h, near, "near")
    w = wrench_array(wrench) + weight(h, r, machine.compiled.gravity(gravity))
    a = matrix(*lines(h, p, r))
    shape = np.broadcast_shapes(a.shape[:-2], w.shape[:-1])
    a, b = scaled(h, np.broadcast_to(a, (*shape, *a.shape[-2:])), -np.broadcast_to(w, (*shape, 6)))
    t, ok, _ = nearest(a.reshape(-1, *a.shape[-2:]), b.reshape(-1, b.shape[-1]), low, high, aim)
    t = np.where(ok[:, None], t, np.nan)
    names = machine.compiled.names.cables
    return TensionDistribution(t.reshape(*shape, len(names)), ok.reshape(shape), names)


def limits(h: Hanging, lowest: ArrayLike, highest: ArrayLike | None) -> tuple[Floats, Floats]:
    """(n,) N each; StiffmapError where the lower is not below the upper."""
    low = _per_cable(h, lowest, "lowest")
    high = h.most if highest is None else _per_cable(h, highest, "highest")
    if not (low < high).all() or (low < 0).any():
        raise StiffmapError(
            f"lowest, highest: expected 0 <= lowest < highest in N, got {low.tolist()} and {high.tolist()}"
        )
    return low, high


def _per_cable(h: Hanging, values: ArrayLike, name: str) -> Floats:
    given = np.asarray(values, dtype=float)
    if given.shape not in ((), h.most.shape) or np.isnan(given).any():
        raise StiffmapError(f"{name}: expected one number of N or {h.most.size}, got {values!r}")
    return np.broadcast_to(given, h.most.shape).astype(float)


def scaled(h: Hanging, a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Rows that no guide takes, moments as forces."""
    size = np.where(np.arange(6) < 3, 1.0, 1.0 / h.length)
    rows = list(h.rows)
    return (a * size[:, None])[..., rows, :], (b * size)[..., rows]


def nearest(
    a: Floats, b: Floats, low: Floats, high: Floats, aim: Floats
) -> tuple[Floats, NDArray[np.bool_], Floats]:
    """Of (m, rows, n) a t = b, low <= t <= high the t nearest to `aim`; whether there is one; the multipliers.

    Newton on the concave dual with t(v) = clip(aim + a' v): piecewise quadratic, each step rises; where nothing is
    feasible it rises for ever along a direction that proves so.
    """
    m, rows, n = a.shape
    v = np.zeros((m, rows))
    size = np.maximum(np.abs(b).max(axis=1, initial=0.0), 1e-6 * np.abs(low).max() + 1e-9)
    done = np.zeros(m, dtype=bool)
    t = np.broadcast_to(np.clip(aim, low, high), (m, n)).copy()

    def dual(v: Floats, of: NDArray[np.intp]) -> tuple[Floats, Floats]:
        t = np.clip(aim + np.einsum("mrn,mr->mn", a[of], v), low, high)
        gap = b[of] - np.einsum("mrn,mn->mr", a[of], t)
        return 0.5 * ((t - aim) ** 2).sum(1) + (v * gap).sum(1), t

    for _ in range(MOST_STEPS):
        todo = np.flatnonzero(~done)
        if todo.size == 0:
            break
        value, t[todo] = dual(v[todo], todo)
        gap = b[todo] - np.einsum("mrn,mn->mr", a[todo], t[todo])
        z = aim + np.einsum("mrn,mr->mn", a[todo], v[todo])
        free = ((z > low) & (z < high)).astype(float)
        done[todo] = np.abs(gap).max(axis=1) < BALANCED * size[todo]
        k = np.einsum("mrn,mn,msn->mrs", a[todo], free, a[todo])
        k += 1e-10 * np.eye(rows)
        step = np.linalg.solve(k, gap[..., None])[..., 0]
        share = np.ones(todo.size)
        for _ in range(60):
            ahead, _t = dual(v[todo] + share[:, None] * step, todo)
            short = ahead < value + 1e-4 * share * (step * gap).sum(1) - 1e-14 * np.abs(value)
            if not short.any():
                break
            share = np.where(short, 0.5 * share, share)
        v[todo] += np.where(done[todo], 0.0, share)[:, None] * step
    return t, done, v
