"""Equilibria along a growing load: Newton on the Lagrangian of the bodies' motions. A step of the load is taken only if
Newton's steps shrink fast, if stability changes in tiny steps only, and if the chord fits the path's tangents."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import lapack
from scipy.spatial.transform import Rotation

from .relative import Array, State, crossed
from .system import System, Tangent

SLACK = 1e-11  # of constraints that depend on each other; gone where Newton's steps end
ITERATIONS = 60
SHORTEST = 1 / 4096
CROSSING = 1 / 512
MOST = 120
LOCK = 0.05  # cosine of a spring's middle angle
FREE = 1e-12  # eigenvalue over the largest of a motion without stiffness


@dataclass(frozen=True)
class Point:
    state: State
    multipliers: Array
    near: Array
    tangent: Tangent
    slope: Array
    """Motion (6 n,) per share of the load."""
    falling: int
    """Negative eigenvalues over the closed motions; of a moment that is not conservative see `Path.falling`."""


@dataclass
class Path:
    """Of a system from a state."""

    system: System
    start: State
    near: Array
    holds: Array = field(default_factory=lambda: np.zeros((0, 0)))
    """Motions (k, 6 n) that nothing holds and that leave the TCP where it is: kept."""
    longest: float = 1.0
    """Share of the load in one step: longer ones may pass an imperfect fork."""
    crossed: bool = False
    goal: tuple[Array, Array] | None = None
    """Position and rotation to which motions that are kept lead the TCP."""
    released: float = 0.0
    """How far (m, rad) the TCP goes from the command to the equilibrium without load; inf: Newton finds none from there."""
    pull: Array | None = None
    """(6,) dead wrench on the TCP that holds the preloaded machine at its command, let go as the load grows."""

    @property
    def conservative(self) -> bool:
        return self.system.kind == "semitangential" or (not self.system.loads.moment.any() and (
            self.system.kind == "dead" or not self.system.loads.force.any()))  # fmt: skip

    def matrix(self, t: Tangent) -> tuple[Array, float]:
        """Scaled tangent with constraints, and the scale of its forces."""
        rows = np.vstack([t.rows, self.holds]) if len(self.holds) else t.rows
        n, m = len(t.slope), len(rows)
        scale = float(np.abs(t.curve).max(initial=0.0)) or 1.0
        out = np.zeros((n + m, n + m))
        out[:n, :n] = t.curve / scale
        out[n:, :n], out[:n, n:] = rows, rows.T
        out[range(n, n + m), range(n, n + m)] = -SLACK
        return out, scale

    def solve(self, t: Tangent, force: Array, gap: Array, way: Array | float = 0.0) -> tuple[Array, Array]:
        """Motions (6 n, ...) and multipliers for forces (6 n, ...) and gaps (m, ...) that are to close; `way`: of
        what is kept."""
        a, scale = self.matrix(t)
        right = np.zeros((len(a), *force.shape[1:]))
        n, m = len(t.slope), len(gap)
        right[:n] = force / scale
        right[n : n + m] = -gap
        right[n + m :] = way
        lu, piv, info = lapack.dgetrf(a)
        if info:
            return np.full(force.shape, np.inf), np.full(gap.shape, np.inf)
        x = lapack.dgetrs(lu, piv, right)[0]
        a[range(n, len(a)), range(n, len(a))] = 0.0
        x += lapack.dgetrs(lu, piv, right - a @ x)[0]  # takes back what the slack has given way
        return x[:n], scale * x[n : n + m]

    def falling(self, t: Tangent) -> int:
        """Falling directions; without a potential one where the determinant says so, else those of the energy's Hessian where some
        motion in a medium that damps all alike grows."""
        a, _ = self.matrix(t)
        n = len(t.slope)
        down = max(0, negative(a) - (len(a) - n))
        if self.conservative or not down:
            return down
        lu, piv, _ = lapack.dgetrf(a)
        sign = np.sign(np.diag(lu)).prod() * (-1) ** int((piv != np.arange(len(piv))).sum())
        if sign * (-1) ** (len(a) - n) < 0:
            return 1
        z = closed(a[n:, :n])
        growth = np.linalg.eigvals(z.T @ a[:n, :n] @ z).real
        return down if growth.min() < -1e-9 * growth.max() else 0

    def tangent(self, at: State, multipliers: Array, near: Array, share: float) -> Tangent:
        t = self.system.at_state(at, multipliers, near, share)
        if self.pull is not None:
            i = 6 * self.system.s.tip
            t.slope[i : i + 6] -= self.pull
            t.load[i : i + 6] += self.pull
            t.curve[i + 3 : i + 6, i + 3 : i + 6] -= (1 - share) * crossed(self.pull[None, 3:])[0] / 2
        return t

    def newton(
        self, at: State, multipliers: Array, near: Array, share: float, free: int = 3
    ) -> tuple[State, Array, Array, Tangent] | None:
        last, seen = np.inf, set()
        for k in range(ITERATIONS):
            t = self.tangent(at, multipliers, near, share)
            force = -(t.slope + share * t.load)
            step, more = self.solve(t, force, t.gap, self.way(at))
            size = float(np.abs(step).max(initial=0.0))
            if not np.isfinite(size) or size > 3:
                return None
            new_piece = t.pieces not in seen
            seen.add(t.pieces)
            at, multipliers, near = at.moved(step), multipliers + more, t.value
            if size < 1e-13 or (size < 3e-11 and size > last / 4):
                t = self.tangent(at, multipliers, near, share)
                return at, multipliers, t.value, t
            if k >= free and not new_piece and not size < min(0.3, last / 4):
                return None
            last = size
        return None

    def point(self, found: tuple[State, Array, Array, Tangent]) -> Point:
        at, multipliers, near, t = found
        slope, _ = self.solve(t, -t.load, np.zeros(len(t.gap)))
        return Point(at, multipliers, near, t, slope, self.falling(t))

    def follow(self) -> tuple[Point | None, str]:
        """The equilibrium under the whole load, and how the path ended: found, ends, locked, given up, singular."""
        multipliers = np.zeros(self.system.closures)
        t = self.system.at_state(self.start, multipliers, self.near, 0.0)
        if not self.hold(t):
            if not self.system.winches or not self.system.loads.gravity.any():
                return None, "singular"
            self.system.weighs = True  # hangs by its weight
        start = self.newton(self.start, multipliers, self.near, 0.0, ITERATIONS)
        if start is None and not len(self.holds):
            start = self.held()
        if start is None:
            return None, "no start"
        at, done, share = self.point(start), 0.0, self.longest
        i = 6 * self.system.s.tip
        far = float(np.abs(at.state.minus(self.start)[i : i + 6]).max())
        self.released = far if self.pull is None else np.inf
        for _ in range(MOST + 2 * int(1 / self.longest)):
            if done == 1:
                return at, "found"
            share = min(share, 1 - done)
            to = self.step(at, done, share)
            if to is None:
                share /= 2
                if share < SHORTEST:
                    return None, "locked" if self.locked(at) else "ends"
            else:
                self.crossed |= to.falling != at.falling
                at, done, share = to, min(1.0, done + share), min(2 * share, self.longest)
        return None, "given up"

    def held(self) -> tuple[State, Array, Array, Tangent] | None:
        """With the TCP held at the command; what holds it is to be let go on the way."""
        self.holds = self.tip()
        found = self.newton(self.start, np.zeros(self.system.closures), self.near, 0.0, ITERATIONS)
        self.holds = np.zeros((0, 0))
        if found is None:
            return None
        i = 6 * self.system.s.tip
        self.pull = found[3].slope[i : i + 6].copy()
        return self.newton(found[0], found[1], found[2], 0.0, 3)

    def locked(self, at: Point) -> bool:
        """A spring is turned by a right angle about y: its three angles are no function of its frames there."""
        return bool((np.abs(np.cos(at.near[self.system.s.measures.sines])) < LOCK).any())

    def tip(self) -> Array:
        out = np.zeros((6, 6 * self.system.s.size))
        out[:, 6 * self.system.s.tip : 6 * self.system.s.tip + 6] = np.eye(6)
        return out

    def way(self, at: State) -> Array | float:
        if self.goal is None:
            return 0.0
        i, (p, r) = self.system.s.tip, self.goal
        return np.asarray(np.r_[p - at.p[i], Rotation.from_matrix(r @ at.r[i].T).as_rotvec()])

    def judged(self, p: Array, r: Array) -> tuple[float, int]:
        """How far (m, rad) the equilibrium is where the TCP is put at p, r and all else is in balance under the whole
        load; and what falls there, -1 where a determinant does not say whether two directions do. NaN where Newton does
        not find how the rest is in balance."""
        i = self.system.s.tip
        p0, turn = self.start.p[i], Rotation.from_matrix(r @ self.start.r[i].T).as_rotvec()
        at: tuple[State, Array, Array] = (self.start, np.zeros(self.system.closures), self.near)
        steps = max(1, int(np.ceil(max(np.abs(p - p0).max(), np.abs(turn).max()) / 0.02)))
        self.holds, found = self.tip(), None
        for k in range(1, steps + 1):
            share = k / steps
            self.goal = (
                p0 + share * (p - p0),
                Rotation.from_rotvec(share * turn).as_matrix() @ self.start.r[i],
            )
            found = self.newton(*at, share, ITERATIONS)
            if found is None:
                break
            at = found[:3]
        self.holds, self.goal = np.zeros((0, 0)), None
        if found is None:
            return np.nan, 0
        t = found[3]
        step, _ = self.solve(t, -(t.slope + t.load), t.gap)
        return float(np.abs(step[6 * i : 6 * i + 6]).max()), self.falling(t)

    def step(self, at: Point, done: float, share: float) -> Point | None:
        guess = at.state.moved(share * at.slope)
        found = self.newton(guess, at.multipliers, at.near, done + share)
        if found is None:
            return None
        to = self.point(found)
        chord = to.state.minus(at.state)
        long = float(np.abs(chord).max(initial=0.0))
        bend = float(np.abs(chord - share * (at.slope + to.slope) / 2).max(initial=0.0))
        crossing = to.falling != at.falling
        if crossing and share > CROSSING:
            return None
        kink = to.tangent.pieces != at.tangent.pieces
        if kink and not crossing and (share < 1 / 64 or long < 0.02):
            return to
        return to if bend <= 1e-9 + (1e-3 if crossing else 0.1) * long else None

    def hold(self, t: Tangent) -> bool:
        """Finds what moves without a load; False where the TCP does."""
        z = closed(t.rows)
        h = z.T @ (t.curve + t.curve.T) @ z / 2
        values, vectors = np.linalg.eigh(h)
        largest = np.abs(values).max(initial=0.0) or 1.0
        free = (z @ vectors[:, np.abs(values) < FREE * largest]).T
        if not len(free):
            return True
        tip = 6 * self.system.s.tip
        if np.abs(free[:, tip : tip + 6]).max() > 1e-7:
            return False
        self.holds = free
        return True


def negative(a: Array) -> int:
    """Negative eigenvalues of a symmetric matrix, by Sylvester's law from its factors."""
    f, pivots, _ = lapack.dsytrf((a + a.T) / 2, lower=1)
    one = pivots > 0
    return int((np.diag(f)[one] < 0).sum()) + int((~one).sum()) // 2  # a block of two has one of each sign


def closed(rows: Array) -> Array:
    """(n, k) orthonormal motions that keep the rows."""
    if not len(rows):
        return np.eye(rows.shape[1])
    values, vectors = np.linalg.eigh(rows.T @ rows)
    free = values < 1e-16 * values[-1]
    # eigenvalues are squares: what is small is looked at again by singular values
    doubtful = np.flatnonzero(values < 1e-9 * values[-1])
    if not free[doubtful].all():
        v = vectors[:, doubtful]
        s, vt = np.linalg.svd(rows @ v)[1:]
        rank = int((s > 1e-8 * np.sqrt(values[-1])).sum())
        return np.asarray(v @ vt[rank:].T)
    return np.asarray(vectors[:, free])


def reduced(t: Tangent, holds: Array) -> Array:
    """Hessian over the closed motions."""
    z = closed(np.vstack([t.rows, holds]) if len(holds) else t.rows)
    h = z.T @ t.curve @ z
    return np.asarray(h + h.T) / 2
