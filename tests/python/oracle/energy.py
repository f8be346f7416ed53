"""An oracle that shares nothing with the core: the potential energy of a description, minimised under
closure by Newton on its Lagrangian with derivatives by autograd. No Jacobian column, no Hessian
formula and no elimination of ours appears here; forces only, since a dead moment has no energy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import autograd.numpy as anp
import numpy as np
from autograd import grad, hessian, jacobian

from stiffmap.description import Block, Body, Joint, MachineDescription, Offset, Spring

CROSS = np.zeros((3, 3, 3))
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    CROSS[_i, _k, _j], CROSS[_i, _j, _k] = 1.0, -1.0


def turned(axis: Any, angle: Any) -> Any:
    """Rotation about a unit axis (Rodrigues)."""
    s = anp.tensordot(anp.array(axis), CROSS, axes=([0], [0])).T * -1.0
    return anp.eye(3) + anp.sin(angle) * s + (1 - anp.cos(angle)) * (s @ s)


@dataclass
class Walk:
    """Coordinates that are used up, energy gathered, loops met."""

    x: Any
    gravity: Any
    used: int = 0
    energy: Any = 0.0
    loops: Any = None

    def take(self, count: int) -> Any:
        self.used += count
        return self.x[self.used - count : self.used]


def along(elements: Any, p: Any, r: Any, walk: Walk) -> Any:
    """Frame behind a sequence; energy and loops go to `walk`."""
    for e in elements:
        if isinstance(e, Offset):
            t = e.actual or e.nominal
            p, r = p + r @ t.p, r @ t.r
        elif isinstance(e, Joint):
            p, r = through_joint(e, p, r, walk)
        elif isinstance(e, Spring):
            p, r = through_spring(e, p, r, walk)
        elif isinstance(e, Body):
            walk.energy = walk.energy - e.mass * anp.dot(walk.gravity, p + r @ anp.array(e.com))
        elif isinstance(e, Block):
            ends = [along(b.elements, p, r, walk) for b in e.branches]
            walk.loops += [(ends[0], end) for end in ends[1:]]
            p, r = ends[0]
    return p, r


def through_joint(e: Joint, p: Any, r: Any, walk: Walk) -> Any:
    for axis, home in zip(e.axes, e.home, strict=True):
        a = 0.0 if e.actuated and e.law is None else walk.take(1)[0]
        if e.law is not None:
            walk.energy = walk.energy + e.law.stiffness * a**2 / 2 + e.law.cubic * a**4 / 4
        if e.kind == "prismatic":
            p = p + (home + a) * (r @ anp.array(axis))
        else:
            r = r @ turned(axis, home + a)
    return p, r


def through_spring(e: Spring, p: Any, r: Any, walk: Walk) -> Any:
    """Translation, then rotations about x, y and z in sequence."""
    theta = walk.take(6)
    d = theta - anp.array(e.rest)
    walk.energy = walk.energy + d @ anp.array(e.stiffness) @ d / 2
    p = p + r @ theta[:3]
    for i in range(3):
        r = r @ turned(np.eye(3)[i], theta[3 + i])
    return p, r


@dataclass(frozen=True)
class Answer:
    position: np.ndarray
    rotation: np.ndarray
    compliance: np.ndarray
    """(6, 3): twist of the tip per unit of force."""
    residual: float


class Oracle:
    """Equilibrium of a description at its home pose under a force at the tip."""

    def __init__(self, description: MachineDescription, gravity: Any = (0.0, 0.0, 0.0)) -> None:
        self.d = description
        self.gravity = np.array(gravity)
        self.size = self._count()

    def _walk(self, x: Any) -> tuple[Any, Any, Walk]:
        walk = Walk(x, self.gravity, loops=[])
        p, r = along(self.d.base, anp.zeros(3), anp.eye(3), walk)
        ends = [along(leg.elements, p, r, walk) for leg in self.d.legs]
        walk.loops += [(ends[0], end) for end in ends[1:]]
        p, r = along(self.d.platform, *ends[0], walk)
        return p, r, walk

    def _count(self) -> int:
        return self._walk(np.zeros(10_000))[2].used

    def _closures(self, x: Any) -> Any:
        out = [anp.zeros(0)]
        for (pa, ra), (pb, rb) in self._walk(x)[2].loops:
            q = ra.T @ rb
            out += [pb - pa, anp.array([q[2, 1] - q[1, 2], q[0, 2] - q[2, 0], q[1, 0] - q[0, 1]])]
        return anp.concatenate(out)

    def solve(self, force: np.ndarray, iterations: int = 40) -> Answer:
        """Newton on the Lagrangian from the unloaded configuration."""

        def lagrangian(x: Any, multipliers: Any) -> Any:
            p, _, walk = self._walk(x)
            return walk.energy - anp.dot(force, p) + anp.dot(multipliers, self._closures(x))

        x = np.zeros(self.size)
        n = len(self._closures(x))
        multipliers = np.zeros(n)
        slope, curve, closing = grad(lagrangian), hessian(lagrangian), jacobian(self._closures)
        for _ in range(iterations):
            a, c = closing(x), self._closures(x)
            system = np.block([[curve(x, multipliers), a.T], [a, np.zeros((n, n))]])
            scale = np.sqrt(1 / np.maximum(np.abs(np.diag(system)), 1.0))
            scale[self.size :] = 1e3
            right = -np.concatenate([slope(x, multipliers), c])
            step = scale * np.linalg.solve(scale[:, None] * system * scale, scale * right)
            x, multipliers = x + step[: self.size], multipliers + step[self.size :]
            if np.abs(step[: self.size]).max() < 1e-13:
                break
        p, r, _ = self._walk(x)
        jp = jacobian(lambda y: self._walk(y)[0])(x)
        jr = np.tensordot(jacobian(lambda y: self._walk(y)[1])(x), r, axes=([1], [1]))  # (3, n, 3)
        spin = 0.5 * np.stack(
            [jr[2, :, 1] - jr[1, :, 2], jr[0, :, 2] - jr[2, :, 0], jr[1, :, 0] - jr[0, :, 1]]
        )
        a = closing(x)
        system = np.block([[curve(x, multipliers), a.T], [a, np.zeros((n, n))]])
        scale = np.sqrt(1 / np.maximum(np.abs(np.diag(system)), 1.0))
        scale[self.size :] = 1e3
        right = np.vstack([jp.T, np.zeros((n, 3))])
        moved = scale[:, None] * np.linalg.solve(scale[:, None] * system * scale, scale[:, None] * right)
        compliance = np.vstack([jp, spin]) @ moved[: self.size]
        left = np.abs(slope(x, multipliers)).max() + np.abs(self._closures(x)).max()
        return Answer(np.asarray(p), np.asarray(r), compliance, float(left))
