"""Stationary energy under closure along a growing load: Newton on the Lagrangian, exact derivatives. A load
step is accepted only if Newton's steps shrink fast, if no eigenvalue of the reduced Hessian changes its
sign unless the step is tiny, and if the chord fits the path's tangents at both ends. What turns freely without
load is held on the way, and then let go downhill."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr

from stiffmap.model.description import MachineDescription

from .energy import Frame, Loads, gap, whole

ITERATIONS = 40
SHORTEST = 2.0**-20  # step of the load: where a path is steep, a thousandth of it still moves far
CROSSING = 1 / 1024  # step across a change of stability
MOST = 200  # load steps tried; beyond, the path is given up as too crooked
SINGULAR = 1e-9  # smallest singular value of the scaled system; that of a sound machine is near 0.1
STILL = 1e-9  # motion of the tip beside that of the joints
LONGEST = 0.3  # rad, of a free turn downhill


@dataclass(frozen=True)
class Judgement:
    """What the energy says of a configuration."""

    off: float
    """Newton's step to the next equilibrium, largest of m and rad."""
    falling: int
    """Negative eigenvalues of the energy's Hessian over the motions that keep the loops closed."""
    lowest: float
    """The lowest eigenvalue over the largest, coordinates scaled to unit stiffness."""


@dataclass(frozen=True)
class Answer:
    position: np.ndarray
    rotation: np.ndarray
    compliance: np.ndarray
    """(6, 6): twist of the tip per unit of a dead wrench."""
    residual: float
    falling: int
    """As of `Judgement`."""
    lowest: float
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
    return Answer(np.full(3, np.nan), np.eye(3), np.full((6, 6), np.nan), np.nan, 0, np.nan, False, kind)


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

    def scaled(self) -> np.ndarray:
        return np.asarray(self.scale[:, None] * self.matrix * self.scale)

    def solve(self, right: np.ndarray) -> np.ndarray:
        s = self.scale.reshape(-1, *[1] * (right.ndim - 1))
        return np.asarray(s * np.linalg.solve(self.scaled(), s * right))

    def reduced(self) -> np.ndarray:
        """Eigenvalues, rising, of the Hessian over the closed motions, coordinates scaled to unit stiffness."""
        n = len(self.slope)
        s = self.scale[:n]
        a, h = self.jacobian * s, s[:, None] * self.curve * s
        values, vt = np.linalg.svd(a)[1:] if len(a) else (np.zeros(0), np.eye(n))
        rank = int((values > 1e-9 * values.max(initial=1e-300)).sum())
        z = vt[rank:]
        return np.asarray(np.linalg.eigvalsh(z @ h @ z.T))

    def tip_jacobian(self) -> np.ndarray:
        """(6, n)"""
        n = len(self.slope)
        jp, jw = np.zeros((3, n)), np.zeros((3, n))
        jp[:, self.tip.of] = self.tip.d[:, :3, 3].T
        w = np.einsum("kab,cb->kac", self.tip.d[:, :3, :3], self.tip.t[:3, :3])  # dR R^T
        jw[:, self.tip.of] = np.stack([w[:, 2, 1], w[:, 0, 2], w[:, 1, 0]])
        return np.vstack([jp, jw])


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
        self.names, self.loops = self._count()
        self.size = len(self.names)
        self.held: dict[int, float] = {}  # coordinates that are kept, and where

    @property
    def closures(self) -> int:
        return self.loops + len(self.held)

    def _count(self) -> tuple[list[str], int]:
        size = 1
        while True:
            try:
                walk = whole(self.d, np.zeros(size), self.loads)[1]
                return walk.names, 6 * len(walk.loops)
            except IndexError:
                size *= 2

    def _system(self, x: np.ndarray, multipliers: np.ndarray, loads: Loads) -> System:
        n = self.size
        tip, walk = whole(self.d, x, loads)
        slope, curve = walk.energy.slope, walk.energy.curve
        stiffness = np.maximum(np.diag(curve).copy(), 1.0)
        own = multipliers[: self.loops].reshape(-1, 6)
        parts = [gap(a, b, m, n) for (a, b), m in zip(walk.loops, own, strict=True)]
        kept = list(self.held)
        values = np.concatenate([*[v for v, _, _ in parts], x[kept] - list(self.held.values())])
        a = np.vstack([*[rows for _, rows, _ in parts], np.eye(n)[kept]])
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
        self.held = {}
        if not self._hold_what_spins():
            return nothing("singular")
        start = self._newton(np.zeros(self.size), np.zeros(self.closures), 0.0, ITERATIONS)
        if start is None:  # no path has begun that could end
            return nothing("given up")
        at, done, share, crossed = self._point(*start, 0.0), 0.0, 1.0, False
        for _ in range(MOST):
            if done == 1:
                return self._answer(at, crossed) if self._let_go(at) else nothing("given up")
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

    def judge(self, coordinates: dict[str, float]) -> Judgement:
        """Of a configuration under all of the loads; `coordinates` count from the description's."""
        x = np.array([coordinates[name] for name in self.names])
        self.held = {j: float(x[j]) for j in self.held}
        system = self._system(x, np.zeros(self.closures), self.loads)
        s = system.scale[: self.size]
        multipliers = np.linalg.lstsq((system.jacobian * s).T, -s * system.slope, rcond=None)[0]
        system = self._system(x, multipliers, self.loads)
        step = system.solve(-np.concatenate([system.slope, system.closures]))[: self.size]
        values = system.reduced()
        return Judgement(float(np.abs(step).max()), int((values < 0).sum()), float(values[0] / values[-1]))

    def _hold_what_spins(self) -> bool:
        """Without load at home: one coordinate of each free motion that leaves the tip; False if one moves it."""
        system = self._system(np.zeros(self.size), np.zeros(self.loops), self.loads.times(0.0))
        _, values, vt = np.linalg.svd(system.scaled())
        free = (vt[values < SINGULAR] * system.scale)[:, : self.size]
        if len(free) == 0:
            return True
        if np.abs(system.tip_jacobian() @ free.T).max() > STILL * np.abs(free).max():
            return False
        self.held = {int(j): 0.0 for j in qr(free, pivoting=True)[2][: len(free)]}
        return True

    def _let_go(self, at: Point) -> bool:
        """From the held equilibrium downhill along every spin that the loads turn, until they hang."""
        for _ in range(200 if self.held else 0):
            kept = list(self.held)
            system = self._system(at.x, at.multipliers, self.loads)
            right = np.zeros((self.size + self.closures, len(kept)))
            right[self.size + self.loops :] = np.eye(len(kept))
            moved = system.solve(right)
            slope = -at.multipliers[self.loops :]
            curve = -moved[self.size + self.loops :]
            noise = 1e-12 * float(np.abs(self._load(at.x)).max(initial=0.0))
            turning = [i for i in range(len(kept)) if abs(slope[i]) > noise or abs(curve[i, i]) > 1e3 * noise]
            values, vectors = np.linalg.eigh(curve[np.ix_(turning, turning)])
            down = vectors.T @ slope[turning]
            turn = -down / np.maximum(np.abs(values), noise)
            turn[(np.abs(down) <= noise) & (values < 0)] = LONGEST
            if not turning or (np.abs(turn).max() < 1e-9 and values[0] > 0):
                for i in turning:
                    del self.held[kept[i]]
                multipliers = np.delete(at.multipliers, [self.loops + i for i in turning])
                polished = self._newton(at.x, multipliers, 1.0)
                if polished is not None:
                    at.x, at.multipliers = polished
                return polished is not None
            step = vectors @ (turn * min(1.0, LONGEST / np.abs(turn).max()))
            for i, by in zip(turning, step, strict=True):
                self.held[kept[i]] += float(by)
            found = self._newton(at.x + moved[: self.size, turning] @ step, at.multipliers, 1.0, ITERATIONS)
            if found is None:
                return False
            at.x, at.multipliers = found
        return not self.held

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
        jacobian = system.tip_jacobian()
        moved = system.solve(np.vstack([jacobian.T, np.zeros((self.closures, 6))]))[: self.size]
        left = np.abs(system.slope).max() + np.abs(system.closures).max(initial=0)
        values, tip = system.reduced(), system.tip
        return Answer(
            tip.t[:3, 3], tip.t[:3, :3], jacobian @ moved, float(left), int((values < 0).sum()),
            float(values[0] / values[-1]), crossed,
        )  # fmt: skip
