"""Relative poses of pairs of frames and their exact first and second derivatives in the motions of the two bodies.

A body moves by p -> p + d, R -> exp(w) R. Of frame B seen from frame A: Q = Ra^T Rb (9 numbers, rows first) and
t = Ra^T (pb - pa); together z (12). A pair's motion is x = (d_a, w_a, d_b, w_b) (12)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

Array = np.ndarray
CROSS = np.zeros((3, 3, 3))  # CROSS[k] = matrix of (axis k) x
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    CROSS[_i, _k, _j], CROSS[_i, _j, _k] = 1.0, -1.0
TWICE = np.einsum("kij,ljm->klim", CROSS, CROSS)
BOTH = (TWICE + np.swapaxes(TWICE, 0, 1)) / 2  # second derivative of exp(w) at 0
FLAT_TWICE, FLAT_BOTH = TWICE.reshape(9, 9).T.copy(), BOTH.reshape(9, 9).T.copy()


@dataclass(frozen=True)
class Frames:
    """Frame i stands at `turn` (m, 3, 3), `shift` (m, 3) on body `body` (m,)."""

    body: Array
    turn: Array
    shift: Array


@dataclass(frozen=True)
class State:
    """Poses of the bodies: (n + 1, 3) and (n + 1, 3, 3); the last is the base, which stands still."""

    p: Array
    r: Array

    def moved(self, x: Array) -> State:
        """By motions (6 n,)."""
        d = x.reshape(-1, 6)
        turn = Rotation.from_rotvec(d[:, 3:]).as_matrix()
        p, r = self.p.copy(), self.r.copy()
        p[:-1] += d[:, :3]
        r[:-1] = turn @ r[:-1]
        return State(p, r)

    def minus(self, other: State) -> Array:
        """Motions (6 n,) that lead from the other state here."""
        turn = Rotation.from_matrix(self.r[:-1] @ np.swapaxes(other.r[:-1], 1, 2)).as_rotvec()
        return np.hstack([self.p[:-1] - other.p[:-1], turn]).ravel()


@dataclass(frozen=True)
class Relative:
    """Of m pairs."""

    z: Array
    """(m, 12)"""
    slope: Array
    """(m, 12, 12): dz/dx."""
    first: Array
    """(m, 3, 3): Ra^T."""
    second: Array
    """(m, 3, 3): Rb."""
    arm: Array
    """(m, 3): from body b to frame B."""
    far: Array
    """(m, 3): from body a to frame B."""

    @staticmethod
    def of(state: State, a: Frames, b: Frames) -> Relative:
        first = np.swapaxes(state.r[a.body] @ a.turn, 1, 2)
        second = state.r[b.body] @ b.turn
        arm_a = np.einsum("mij,mj->mi", state.r[a.body], a.shift)
        arm = np.einsum("mij,mj->mi", state.r[b.body], b.shift)
        far = state.p[b.body] + arm - state.p[a.body]
        m = len(first)
        z, g = np.empty((m, 12)), np.zeros((m, 12, 12))
        z[:, :9] = (first @ second).reshape(m, 9)
        z[:, 9:] = np.einsum("mij,mj->mi", first, far - arm_a)
        turned = (first[:, None] @ CROSS @ second[:, None]).reshape(m, 3, 9)
        g[:, :9, 9:] = np.swapaxes(turned, 1, 2)
        g[:, :9, 3:6] = -g[:, :9, 9:]
        g[:, 9:, 6:9], g[:, 9:, 0:3] = first, -first
        g[:, 9:, 9:] = -(first @ crossed(arm))
        g[:, 9:, 3:6] = first @ crossed(far)
        return Relative(z, g, first, second, arm, far)

    def curve(self, w: Array) -> Array:
        """Second derivatives (m, 12, 12) of sum(w z), weights w (m, 12)."""
        m = len(w)
        out = np.zeros((m, 12, 12))
        turn = np.swapaxes(self.first, 1, 2) @ w[:, :9].reshape(m, 3, 3) @ np.swapaxes(self.second, 1, 2)
        v = np.einsum("mji,mj->mi", self.first, w[:, 9:])
        near = turn + v[:, :, None] * self.arm[:, None, :]
        far = turn + v[:, :, None] * self.far[:, None, :]
        out[:, 9:, 9:] = (near.reshape(m, 9) @ FLAT_BOTH).reshape(m, 3, 3)
        out[:, 3:6, 3:6] = (far.reshape(m, 9) @ FLAT_BOTH).reshape(m, 3, 3)
        out[:, 3:6, 9:] = -(near.reshape(m, 9) @ FLAT_TWICE).reshape(m, 3, 3)
        mixed = np.einsum("mi,kil->mkl", v, CROSS)
        out[:, 3:6, 6:9], out[:, 3:6, 0:3] = -mixed, mixed
        out[:, 9:, 3:6] = np.swapaxes(out[:, 3:6, 9:], 1, 2)
        out[:, 6:9, 3:6] = np.swapaxes(out[:, 3:6, 6:9], 1, 2)
        out[:, 0:3, 3:6] = np.swapaxes(out[:, 3:6, 0:3], 1, 2)
        return out


def crossed(v: Array) -> Array:
    """(m, 3, 3): matrices of v x, v (m, 3)."""
    return np.asarray(np.einsum("mk,kij->mij", v, CROSS))
