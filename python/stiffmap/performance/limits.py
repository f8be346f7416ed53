"""What keeps a pose inside the workspace, as smooth arrays and convex functions of them.

A box of poses is judged from its nodes: between them each smooth array stays within its multilinear
interpolant plus (1/8) sum h_k^2 max|second derivative along k|, and the largest value of a convex
function of the interpolant lies at a node (docs/theory.md D8).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from stiffmap.broadcasting import Floats
from stiffmap.errors import StiffmapError
from stiffmap.machine import Machine
from stiffmap.performance.closing import drive_kinematics
from stiffmap.performance.scaling import characteristic_length, weighted
from stiffmap.performance.zonotopes import inverse_rows
from stiffmap.status import Status

UNLIMITED = 1e299


@dataclass(frozen=True, eq=False)
class Limit:
    """One convex bound ``value <= most`` at nodes (n,), of a smooth array."""

    name: str
    value: Floats
    """(n,)"""
    most: float
    array: Floats
    """(n, a) the smooth array, in the unit of `value`: |change of value| <= |change of array|."""
    left: Floats
    """(n, a) with right: lower estimate of the value at a neighbour is left·(array there)."""


@dataclass(frozen=True)
class Bounds:
    """What a workspace asks of a pose; see `stiffmap.performance.largest_box`."""

    machine: Machine
    rotation: Floats | None = None
    transmission: tuple[float, float] | None = None
    factors: str = "sphere"
    length: float | None = None
    ranges: bool = True
    joints: bool = True
    threads: int | None = None
    counter: list[int] = field(default_factory=lambda: [0])

    def __post_init__(self) -> None:
        if self.transmission is not None:
            low, high = self.transmission
            if not 0 <= low < high:
                raise StiffmapError(
                    f"transmission: expected (lowest, highest) with 0 <= lowest < highest, got ({low}, {high})"
                )
        if self.factors != "sphere":
            raise StiffmapError(f"factors: expected 'sphere' (singular values), got {self.factors!r}")

    def at(self, position: Floats) -> tuple[NDArray[np.bool_], list[Limit]]:
        """Which poses (n, 3) close, and the limits there."""
        self.counter[0] += len(position)
        k = drive_kinematics(self.machine, position, self.rotation, patient=False, threads=self.threads)
        closed = k.status == Status.CONVERGED
        limits: list[Limit] = []
        if self.transmission is not None:
            size = characteristic_length(self.machine, self.length)
            j = weighted(self.machine, k.jacobian, size, "all")
            low, high = self.transmission
            limits.append(_spectral("transmission above", j, high, closed))
            if low > 0:
                limits.append(_spectral("transmission below", inverse_rows(j), 1 / low, closed))
        limits.extend(self._intervals(k.coordinates))
        return closed, limits

    def _intervals(self, x: Floats) -> list[Limit]:
        out = []
        for index, name, low, high in _coordinate_limits(self.machine, self.ranges, self.joints):
            for sign, most in ((1.0, high), (-1.0, -low)):
                if abs(most) < UNLIMITED:
                    value = sign * x[:, index]
                    out.append(Limit(name, value, most, value[:, None], np.ones((len(x), 1))))
        return out


def _coordinate_limits(machine: Machine, ranges: bool, joints: bool) -> list[tuple[int, str, float, float]]:
    compiled = machine.compiled
    drives = set(compiled.drives)
    out = []
    for i, (low, high) in enumerate(compiled.limits):
        wanted = ranges if i in drives else joints
        if wanted and (abs(low) < UNLIMITED or abs(high) < UNLIMITED):
            kind = "range of" if i in drives else "joint limit of"
            out.append((i, f"{kind} {compiled.names.coordinates[i]}", low, high))
    return out


def _spectral(name: str, matrix: Floats, most: float, closed: NDArray[np.bool_]) -> Limit:
    """Largest singular value, and its dyad: a linear lower estimate at neighbours."""
    n = len(matrix)
    value = np.full(n, np.inf)
    left = np.full((n, matrix.shape[1] * matrix.shape[2]), np.nan)
    ok = closed & np.isfinite(matrix).all(axis=(1, 2))
    if ok.any():
        u, s, vh = np.linalg.svd(matrix[ok], full_matrices=False)
        value[ok] = s[:, 0]
        left[ok] = (u[:, :, 0, None] * vh[:, None, 0, :]).reshape(ok.sum(), -1)
    return Limit(name, value, most, matrix.reshape(n, -1), left)
