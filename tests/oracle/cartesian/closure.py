"""Closing a structure: joints as they are, springs rigid, the TCP or the drives commanded. Newton's steps of least
motion, exact to round-off; a pose is reached from home along a straight line with one turn about one axis."""

from __future__ import annotations

import numpy as np
from scipy.linalg import lapack
from scipy.spatial.transform import Rotation

from stiffmap.model.description import Pose

from .relative import Array, Relative, State
from .structure import Structure

SLACK = 1e-11  # of what constraints that depend on each other may share


SHORTEST = 1 / 4096  # of the way
LONG = 0.15  # m, rad: of a step of Newton after the first; longer ones may lead to another branch


class Unreachable(Exception):
    """Nothing closes there."""


class Closure:
    """Of a structure as drawn. `finer`: steps so many times as short, which lose a branch near a singular pose less easily."""

    def __init__(self, s: Structure, finer: int = 1) -> None:
        self.s, self.finer = s, finer
        self.rigid = [*s.where("keep"), *s.where("spring")]
        self.joints = s.where("joint")

    def measured(self, at: State, near: Array) -> tuple[Array, Array]:
        """All measures, and their slopes (k, 6 n) in the motions of the bodies."""
        rel = Relative.of(at, *self.s.frames)
        m = self.s.measures
        value, slope, _ = m.at(rel.z, near)
        own = np.einsum("ij,ijk->ik", slope, rel.slope[m.pair])
        return value, spread(own, self.s)

    def home(self) -> tuple[State, Array]:
        """The closed home: bodies and measures."""
        home = self.s.d.home
        return self.reach(self.s.start, self.s.home, np.array(home.p), np.array(home.r), {}, steps=1)

    def at_pose(self, home: tuple[State, Array], pose: Pose) -> tuple[State, Array]:
        p, r = np.array(pose.p), np.array(pose.r)
        far = np.abs(np.r_[p - self.s.d.home.p, r.ravel() - np.ravel(self.s.d.home.r)]).max()
        return self.reach(*home, p, r, {}, steps=self.finer * max(1, int(np.ceil(far / 0.08))))

    def at_drives(self, home: tuple[State, Array], command: dict[str, float]) -> tuple[State, Array]:
        """`command` by full name."""
        at = {self.s.names.index(n): v for n, v in command.items()}
        far = max((abs(v - home[1][i]) for i, v in at.items()), default=0.0)
        return self.reach(*home, None, None, at, steps=self.finer * max(1, int(np.ceil(far / 0.15))))

    def reach(
        self, at: State, near: Array, p: Array | None, r: Array | None, drives: dict[int, float], steps: int
    ) -> tuple[State, Array]:
        p0, r0 = at.p[self.s.tip], at.r[self.s.tip]
        values0 = near.copy()
        done, step = 0.0, 1.0 / steps
        while done < 1:
            share = min(1.0, done + step)
            to_p = None if p is None else p0 + share * (p - p0)
            to_r = None
            if r is not None:
                turn = Rotation.from_matrix(r @ r0.T).as_rotvec()
                to_r = Rotation.from_rotvec(share * turn).as_matrix() @ r0
            to = {i: values0[i] + share * (v - values0[i]) for i, v in drives.items()}
            try:
                at, near = self.newton(at, near, to_p, to_r, to, last=share == 1)
            except Unreachable:
                step /= 2
                if step < SHORTEST:
                    raise
                continue
            done, step = share, 2 * step if self.finer == 1 else min(2 * step, 1.0 / steps)
        return at, near

    def newton(
        self, at: State, near: Array, p: Array | None, r: Array | None, drives: dict[int, float], last: bool
    ) -> tuple[State, Array]:
        rows = [*self.rigid, *drives]
        goal = np.r_[np.zeros(len(self.rigid)), list(drives.values())]
        tip, size = 6 * self.s.tip, np.inf
        for k in range(25):
            value, slope = self.measured(at, near)
            c, a = value[rows] - goal, slope[rows]
            if p is not None and r is not None:
                task = self.s.d.task
                pick = np.zeros((6, a.shape[1]))
                pick[:3, tip : tip + 3] = np.eye(3)
                pick[3:, tip + 3 : tip + 6] = r.T
                turn = r.T @ Rotation.from_matrix(at.r[self.s.tip] @ r.T).as_rotvec()
                use = [i for i, n in enumerate(("x", "y", "z", "rx", "ry", "rz")) if n in task]
                a = np.vstack([a, pick[use]])
                c = np.r_[c, np.r_[at.p[self.s.tip] - p, turn][use]]
            if size < (1e-11 if last else 1e-7):
                if np.abs(c).max(initial=0.0) > 1e-9:
                    raise Unreachable(f"{np.abs(c).max():.1e} off")
                return at, value
            step = least(a, -c)
            size = float(np.abs(step).max(initial=0.0))
            if not size < (2 * LONG if k == 0 else LONG):
                raise Unreachable("far off")
            at, near = at.moved(step), value
        raise Unreachable("no end of steps")


def least(a: Array, c: Array) -> Array:
    """The least step x with a x = c; where rows depend on each other, as near as they allow."""
    _, x, info = lapack.dposv(a @ a.T + SLACK * np.eye(len(a)), c, lower=1)
    if info:
        raise Unreachable("rows that contradict each other")
    return np.asarray(a.T @ x)


def spread(own: Array, s: Structure, which: Array | None = None) -> Array:
    """Slopes (k, 12) of measures (all, or these) in the motions of their own two bodies -> (k, 6 n)."""
    pair = s.measures.pair if which is None else s.measures.pair[which]
    a, b = (f.body[pair] for f in s.frames)
    out = np.zeros((len(own), s.size + 1, 6))
    k = np.arange(len(own))
    out[k, a] = own[:, :6]
    out[k, b] += own[:, 6:]
    return out[:, :-1].reshape(len(own), 6 * s.size)
