"""Stationary energy under closure: Newton on the Lagrangian, all derivatives by autograd."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import autograd.numpy as anp
import numpy as np
from autograd import grad

from stiffmap.description import MachineDescription

from .energy import Loads, gaps, whole

ITERATIONS = 40
SHORTEST = 1 / 512  # step of the load


@dataclass(frozen=True)
class Answer:
    position: np.ndarray
    rotation: np.ndarray
    compliance: np.ndarray
    """(6, 3): twist of the tip per unit of force."""
    residual: float
    stable: bool
    """The energy is a minimum among the configurations that close."""
    kind: str = "found"
    """Or ``ends``: no equilibrium further along the path of loads; ``singular``: free without load."""


SINGULAR = 1e-9  # smallest singular value of the scaled system; that of a sound machine is near 0.1


def nothing(kind: str) -> Answer:
    """No equilibrium."""
    return Answer(np.full(3, np.nan), np.eye(3), np.full((6, 3), np.nan), np.nan, False, kind)


class Oracle:
    """Equilibrium of a description at its home pose."""

    def __init__(self, description: MachineDescription, loads: Loads) -> None:
        self.d, self.loads = description, loads
        walk = whole(description, np.zeros((1, 10_000)), loads)[2]
        self.size, self.closures = walk.used, 6 * len(walk.loops)

    def _outputs(self, x: Any) -> Any:
        """Closures, tip, rotation (batch, m + 12): everything whose Jacobian is wanted."""
        p, r, walk = whole(self.d, x, self.loads)
        return anp.concatenate([gaps(walk), p, anp.reshape(r, (len(x), 9))], axis=1)

    def _jacobian(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Outputs and their Jacobian, one row of the batch per output."""
        count = self.closures + 12
        rows = grad(lambda y: anp.sum(self._outputs(y) * np.eye(count)))(np.tile(x, (count, 1)))
        return self._outputs(x[None])[0], rows

    def _curve(self, x: np.ndarray, multipliers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gradient and Hessian of the Lagrangian in x, one row of the batch per unit vector."""

        def lagrangian(y: Any) -> Any:
            _, _, walk = whole(self.d, y, self.loads)
            return anp.sum(walk.energy) + anp.sum(anp.dot(gaps(walk), multipliers))

        many = np.tile(x, (self.size, 1))
        slope = grad(lagrangian)
        hessian = grad(lambda y: anp.sum(slope(y) * np.eye(self.size)))(many)
        return slope(x[None])[0], (hessian + hessian.T) / 2

    def _system(self, x: np.ndarray, multipliers: np.ndarray) -> tuple[Any, ...]:
        slope, curve = self._curve(x, multipliers)
        values, jacobian = self._jacobian(x)
        a, n = jacobian[: self.closures], self.closures
        system = np.block([[curve, a.T], [a, np.zeros((n, n))]])
        scale = np.sqrt(1 / np.maximum(np.abs(np.diag(system)), 1.0))
        scale[self.size :] = 1e3
        return slope, curve, values, jacobian, system, scale

    def solve(self) -> Answer:
        """Along the path from no load to all of it; a Newton solve whose steps do not shrink is not trusted
        as its continuation, and the step of the load is halved."""
        full, done, share = self.loads, 0.0, 1.0
        if self._free():
            return nothing("singular")
        start = self._newton(np.zeros(self.size), np.zeros(self.closures), 0.0, full, ITERATIONS)
        while done < 1 and share > SHORTEST and start is not None:
            share = min(share, 1 - done)
            found = self._newton(*start, done + share, full)
            if found is None:
                share /= 2
            else:
                start, done, share = found, done + share, 2 * share
        self.loads = full
        return nothing("ends") if start is None or done < 1 else self._answer(*start)

    def _free(self) -> bool:
        """Something moves without load."""
        self.loads, full = self.loads.times(0.0), self.loads
        *_, system, scale = self._system(np.zeros(self.size), np.zeros(self.closures))
        self.loads = full
        return bool(np.linalg.svd(scale[:, None] * system * scale)[1][-1] < SINGULAR)

    def _newton(
        self, x: np.ndarray, multipliers: np.ndarray, share: float, full: Loads, free: int = 0
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Solution under a share of the loads; the first `free` steps may be of any length."""
        self.loads = full.times(share)
        last = np.inf
        for k in range(ITERATIONS):
            slope, _, values, _, system, scale = self._system(x, multipliers)
            right = -np.concatenate([slope, values[: self.closures]])
            step = scale * np.linalg.solve(scale[:, None] * system * scale, scale * right)
            x, multipliers = x + step[: self.size], multipliers + step[self.size :]
            size = np.abs(step[: self.size]).max()
            if size < 1e-13 or (size < 1e-11 and size > last / 4):
                return x, multipliers
            if k >= free and not size < min(0.3, last / 4):
                return None
            last = size
        return None

    def _answer(self, x: np.ndarray, multipliers: np.ndarray) -> Answer:
        slope, curve, values, jacobian, system, scale = self._system(x, multipliers)
        a, jp, jr = np.split(jacobian, [self.closures, self.closures + 3])
        p, r = values[self.closures : self.closures + 3], values[self.closures + 3 :].reshape(3, 3)
        w = np.einsum("ikn,jk->ijn", jr.reshape(3, 3, -1), r)  # dR R^T
        spin = 0.5 * np.stack([w[2, 1] - w[1, 2], w[0, 2] - w[2, 0], w[1, 0] - w[0, 1]])
        right = np.vstack([jp.T, np.zeros((self.closures, 3))])
        moved = scale[:, None] * np.linalg.solve(scale[:, None] * system * scale, scale[:, None] * right)
        left = np.abs(slope).max() + np.abs(values[: self.closures]).max(initial=0)
        motions = np.linalg.svd(a)[2][self.closures :] if self.closures else np.eye(self.size)
        lowest = np.linalg.eigvalsh(motions @ curve @ motions.T).min()
        return Answer(p, r, np.vstack([jp, spin]) @ moved[: self.size], float(left), bool(lowest > 0))
