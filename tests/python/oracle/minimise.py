"""Stationary energy under closure along a growing load: Newton on the Lagrangian, exact derivatives. A load
step is accepted only if Newton's steps shrink fast, if no eigenvalue of the reduced Hessian changes its
sign unless the step is tiny, and if the chord fits the path's tangents at both ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stiffmap.description import MachineDescription

from .energy import Frame, Loads, gap, whole

ITERATIONS = 40
SHORTEST = 1 / 8192  # step of the load
CROSSING = 1 / 1024  # step across a change of stability
MOST = 80  # load steps tried; beyond, the path is given up as too crooked
SINGULAR = 1e-9  # smallest singular value of the scaled system; that of a sound machine is near 0.1


@dataclass(frozen=True)
class Answer:
    position: np.ndarray
    rotation: np.ndarray
    compliance: np.ndarray
    """(6, 3): twist of the tip per unit of force."""
    residual: float
    falling: int
    """Negative eigenvalues of the energy's Hessian over the motions that keep the loops closed."""
    lowest: float
    """The lowest of them over the largest, coordinates scaled to unit stiffness."""
    crossed: bool
    """The path went through a change of stability."""
    kind: str = "found"
    """Or ``ends``: no equilibrium further along the path of loads; ``given up``: too many steps; ``singular``:
    free without load."""

    @property
    def stable(self) -> bool:
        return self.falling == 0


def nothing(kind: str) -> Answer:
    """No equilibrium."""
    return Answer(np.full(3, np.nan), np.eye(3), np.full((6, 3), np.nan), np.nan, 0, np.nan, False, kind)


@dataclass(frozen=True)
class System:
    """All derivatives at one configuration."""

    slope: np.ndarray
    curve: np.ndarray
    closures: np.ndarray
    jacobian: np.ndarray
    tip: Frame
    matrix: np.ndarray
    scale: np.ndarray

    def solve(self, right: np.ndarray) -> np.ndarray:
        s = self.scale.reshape(-1, *[1] * (right.ndim - 1))
        return np.asarray(s * np.linalg.solve(self.scale[:, None] * self.matrix * self.scale, s * right))

    def reduced(self) -> np.ndarray:
        """Eigenvalues, rising, of the Hessian over the closed motions, coordinates scaled to unit stiffness."""
        n = len(self.slope)
        s = self.scale[:n]
        a, h = self.jacobian * s, s[:, None] * self.curve * s
        values, vt = np.linalg.svd(a)[1:] if len(a) else (np.zeros(0), np.eye(n))
        rank = int((values > 1e-9 * values.max(initial=1e-300)).sum())
        z = vt[rank:]
        return np.asarray(np.linalg.eigvalsh(z @ h @ z.T))


@dataclass
class Point:
    """An equilibrium of the path."""

    x: np.ndarray
    multipliers: np.ndarray
    slope: np.ndarray
    """d x / d share of the load."""
    falling: int


class Oracle:
    """Equilibrium of a description at its home pose."""

    def __init__(self, description: MachineDescription, loads: Loads) -> None:
        self.d, self.loads = description, loads
        self.size, self.closures = self._count()

    def _count(self) -> tuple[int, int]:
        size = 1
        while True:
            try:
                walk = whole(self.d, np.zeros(size), self.loads)[1]
                return walk.used, 6 * len(walk.loops)
            except IndexError:
                size *= 2

    def _system(self, x: np.ndarray, multipliers: np.ndarray, loads: Loads) -> System:
        n = self.size
        tip, walk = whole(self.d, x, loads)
        slope, curve = walk.energy.slope, walk.energy.curve
        stiffness = np.maximum(np.diag(curve).copy(), 1.0)
        parts = [gap(a, b, m, n) for (a, b), m in zip(walk.loops, multipliers.reshape(-1, 6), strict=True)]
        values = np.concatenate([np.zeros(0), *[v for v, _, _ in parts]])
        a = np.vstack([np.zeros((0, n)), *[rows for _, rows, _ in parts]])
        curve = sum((c for _, _, c in parts), start=curve)
        matrix = np.block([[curve, a.T], [a, np.zeros((len(a), len(a)))]])
        scale = np.concatenate(
            [1 / np.sqrt(np.maximum(stiffness, np.abs(np.diag(curve)))), np.full(len(a), 1e3)]
        )
        return System(slope + multipliers @ a, curve, values, a, tip, matrix, scale)

    def _load(self, x: np.ndarray) -> np.ndarray:
        """Gradient of the loads' potential at their full size."""
        return np.asarray(
            whole(self.d, x, self.loads)[1].energy.slope
            - whole(self.d, x, self.loads.times(0.0))[1].energy.slope
        )

    def _point(self, x: np.ndarray, multipliers: np.ndarray, share: float) -> Point:
        system = self._system(x, multipliers, self.loads.times(share))
        right = np.concatenate([-self._load(x), np.zeros(self.closures)])
        return Point(x, multipliers, system.solve(right)[: self.size], int((system.reduced() < 0).sum()))

    def solve(self) -> Answer:
        """Along the path from no load to all of it."""
        zero = np.zeros(self.size), np.zeros(self.closures)
        system = self._system(*zero, self.loads.times(0.0))
        if np.linalg.svd(system.scale[:, None] * system.matrix * system.scale)[1][-1] < SINGULAR:
            return nothing("singular")
        start = self._newton(*zero, 0.0, ITERATIONS)
        if start is None:
            return nothing("ends")
        at, done, share, crossed = self._point(*start, 0.0), 0.0, 1.0, False
        for _ in range(MOST):
            if done == 1:
                return self._answer(at, crossed)
            share = min(share, 1 - done)
            step = self._step(at, done, share)
            if step is None:
                share /= 2
                if share < SHORTEST:
                    return nothing("ends")
            else:
                crossed |= step.falling != at.falling
                at, done, share = step, min(1.0, done + share), 2 * share
        return nothing("given up")

    def _step(self, at: Point, done: float, share: float) -> Point | None:
        # the tangent predicts, so that Newton starts from the path's own direction
        found = self._newton(at.x + share * at.slope, at.multipliers, done + share)
        if found is None:
            return None
        to = self._point(*found, done + share)
        chord = to.x - at.x
        bend = np.abs(chord - share * (at.slope + to.slope) / 2).max()
        crossing = to.falling != at.falling
        if crossing and share > CROSSING:
            return None
        return to if bend <= 1e-9 + (1e-3 if crossing else 0.1) * np.abs(chord).max() else None

    def _newton(
        self, x: np.ndarray, multipliers: np.ndarray, share: float, free: int = 0
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Solution under a share of the loads; the first `free` steps may be of any length."""
        loads, last = self.loads.times(share), np.inf
        for k in range(ITERATIONS):
            system = self._system(x, multipliers, loads)
            step = system.solve(-np.concatenate([system.slope, system.closures]))
            x, multipliers = x + step[: self.size], multipliers + step[self.size :]
            size = np.abs(step[: self.size]).max()
            if size < 1e-13 or (size < 1e-11 and size > last / 4):
                return x, multipliers
            if k >= free and not size < min(0.3, last / 4):
                return None
            last = size
        return None

    def _answer(self, at: Point, crossed: bool) -> Answer:
        system = self._system(at.x, at.multipliers, self.loads)
        tip, n = system.tip, self.size
        jp, jw = np.zeros((3, n)), np.zeros((3, n))
        jp[:, tip.of] = tip.d[:, :3, 3].T
        w = np.einsum("kab,cb->kac", tip.d[:, :3, :3], tip.t[:3, :3])  # dR R^T
        jw[:, tip.of] = np.stack([w[:, 2, 1], w[:, 0, 2], w[:, 1, 0]])
        moved = system.solve(np.vstack([jp.T, np.zeros((self.closures, 3))]))[:n]
        left = np.abs(system.slope).max() + np.abs(system.closures).max(initial=0)
        values = system.reduced()
        return Answer(
            tip.t[:3, 3], tip.t[:3, :3], np.vstack([jp, jw]) @ moved, float(left), int((values < 0).sum()),
            float(values[0] / values[-1]), crossed,
        )  # fmt: skip
