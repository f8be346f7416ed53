"""The potential energy of a description under loads, with its closures: plain transforms, many
configurations at once. No Jacobian column, no Hessian formula and no elimination of ours appears here.

Forces at named points are dead. A semitangential moment m at the tip has the energy -tr(S(m)^T R) / 2,
R being the rotation of the tip since the command; a dead moment has none."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import autograd.numpy as anp
import numpy as np

from stiffmap.description import Block, Body, Joint, MachineDescription, Offset, Point, Spring

CROSS = np.zeros((3, 3, 3))  # CROSS[i] = matrix of (axis i) x
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    CROSS[_i, _k, _j], CROSS[_i, _j, _k] = 1.0, -1.0


@dataclass(frozen=True)
class Loads:
    """SI, base axes."""

    force: np.ndarray
    """At the tip."""
    moment: np.ndarray
    """Semitangential, at the tip."""
    gravity: np.ndarray
    at_points: dict[str, np.ndarray]
    """Dead forces by full name of the point."""

    def times(self, share: float) -> Loads:
        """All loads by a factor."""
        at = {n: share * f for n, f in self.at_points.items()}
        return Loads(share * self.force, share * self.moment, share * self.gravity, at)


@dataclass
class Walk:
    """Coordinates (batch, n) that are used up, energy gathered, loops met."""

    x: Any
    loads: Loads
    used: int = 0
    energy: Any = 0.0
    loops: list[Any] = field(default_factory=list)

    def take(self, count: int) -> Any:
        self.used += count
        return self.x[:, self.used - count : self.used]


def turned(axis: Any, angle: Any) -> Any:
    """Rotations about a unit axis (Rodrigues)."""
    s = np.tensordot(np.array(axis), CROSS, axes=1)
    a = angle[:, None, None]
    return np.eye(3) + anp.sin(a) * s + (1 - anp.cos(a)) * (s @ s)


def times(r: Any, v: Any) -> Any:
    """Rotations on one vector or on one for each."""
    return anp.einsum("bij,bj->bi", r, v) if v.ndim == 2 else anp.einsum("bij,j->bi", r, v)


def along(elements: Any, p: Any, r: Any, walk: Walk, name: str) -> Any:
    """Frame behind a sequence; energy and loops go to `walk`."""
    for e in elements:
        if isinstance(e, Offset):
            t = e.actual or e.nominal
            p, r = p + times(r, t.p), anp.matmul(r, t.r)
        elif isinstance(e, Joint):
            p, r = through_joint(e, p, r, walk)
        elif isinstance(e, Spring):
            p, r = through_spring(e, p, r, walk)
        elif isinstance(e, Body):
            at = p + times(r, np.array(e.com))
            walk.energy = walk.energy - e.mass * anp.dot(at, walk.loads.gravity)
        elif isinstance(e, Point):
            at, f = p + times(r, np.array(e.offset)), walk.loads.at_points.get(f"{name}.{e.name}")
            walk.energy = walk.energy - (0.0 if f is None else anp.dot(at, f))
        elif isinstance(e, Block):
            ends = [along(b.elements, p, r, walk, f"{name}.{b.name}") for b in e.branches]
            walk.loops += [(ends[0], end) for end in ends[1:]]
            p, r = ends[0]
    return p, r


def through_joint(e: Joint, p: Any, r: Any, walk: Walk) -> Any:
    laws = e.axis_laws or (e.law,) * len(e.axes)
    for axis, home, law, rest in zip(e.axes, e.home, laws, e.rest or e.home, strict=True):
        a = 0.0 * walk.x[:, 0] if e.actuated and law is None else walk.take(1)[:, 0]
        if law is not None:
            d = a + (home - rest)
            walk.energy = walk.energy + law.stiffness * d**2 / 2 + law.cubic * d**4 / 4
        if e.kind == "prismatic":
            p = p + (home + a)[:, None] * times(r, np.array(axis))
        else:
            r = anp.matmul(r, turned(axis, home + a))
    return p, r


def through_spring(e: Spring, p: Any, r: Any, walk: Walk) -> Any:
    """Translation, then rotations about x, y and z in sequence."""
    theta = walk.take(6)
    d = theta - np.array(e.rest)
    walk.energy = walk.energy + anp.sum(d * anp.dot(d, np.array(e.stiffness)), axis=1) / 2
    p = p + times(r, theta[:, :3])
    for i in range(3):
        r = anp.matmul(r, turned(np.eye(3)[i], theta[:, 3 + i]))
    return p, r


def whole(d: MachineDescription, x: Any, loads: Loads) -> tuple[Any, Any, Walk]:
    """Tip frames (batch, 3), (batch, 3, 3) of all configurations, and what the walk gathered."""
    walk = Walk(x, loads)
    start = np.zeros((len(x), 3)), np.zeros((len(x), 3, 3)) + np.eye(3)
    start = along(d.base, *start, walk, "base")
    ends = [along(leg.elements, *start, walk, leg.name) for leg in d.legs]
    walk.loops += [(ends[0], end) for end in ends[1:]]
    p, r = along(d.platform, *ends[0], walk, "platform")
    turn = anp.einsum("bij,kj->bik", r, d.home.r)
    tilt = anp.sum(np.tensordot(loads.moment, CROSS, axes=1) * turn, axis=(1, 2))
    walk.energy = walk.energy - anp.dot(p, loads.force) - tilt / 2
    return p, r, walk


def gaps(walk: Walk) -> Any:
    """Closures (batch, m) of all loops."""
    out = []
    for (pa, ra), (pb, rb) in walk.loops:
        q = anp.einsum("bji,bjk->bik", ra, rb)
        out.append(pb - pa)
        out.append(anp.stack([q[:, 2, 1] - q[:, 1, 2], q[:, 0, 2] - q[:, 2, 0], q[:, 1, 0] - q[:, 0, 1]], 1))
    return anp.concatenate(out, 1) if out else np.zeros((len(walk.x), 0))
