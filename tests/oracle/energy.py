"""The potential energy of a description under loads, with its closures: plain transforms, each with its
first and second derivatives. No Jacobian column, no Hessian formula and no elimination of ours appears here.

Forces at named points are dead. A semitangential moment m at the tip has the energy -tr(S(m)^T R) / 2,
R being the rotation of the tip since the command; a dead moment has none."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from stiffmap.model.description import Block, Body, Joint, MachineDescription, Offset, Point, Spring

CROSS = np.zeros((3, 3, 3))  # CROSS[i] = matrix of (axis i) x
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    CROSS[_i, _k, _j], CROSS[_i, _j, _k] = 1.0, -1.0


EYE = np.eye(4)
UNITS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


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
class Frame:
    """Homogeneous matrix (4, 4) of a frame, its derivatives (k, 4, 4) and (k, k, 4, 4) in the coordinates
    on the way to it, whose numbers are `of`."""

    t: np.ndarray
    of: list[int]
    d: np.ndarray
    dd: np.ndarray

    @staticmethod
    def base() -> Frame:
        return Frame(np.eye(4), [], np.zeros((0, 4, 4)), np.zeros((0, 0, 4, 4)))

    def fixed(self, m: np.ndarray) -> Frame:
        """Behind a constant transform."""
        return Frame(self.t @ m, self.of, self.d @ m, self.dd @ m)

    def moved(self, number: int, m: np.ndarray, m1: np.ndarray, m2: np.ndarray) -> Frame:
        """Behind a transform of one more coordinate; its value and two derivatives."""
        k = len(self.of)
        d = np.empty((k + 1, 4, 4))
        dd = np.empty((k + 1, k + 1, 4, 4))
        d[:k], d[k] = self.d @ m, self.t @ m1
        dd[:k, :k], dd[k, k] = self.dd @ m, self.t @ m2
        dd[:k, k] = dd[k, :k] = self.d @ m1
        return Frame(self.t @ m, [*self.of, number], d, dd)


@dataclass
class Sum:
    """A scalar with gradient (n,) and Hessian (n, n)."""

    slope: np.ndarray
    curve: np.ndarray

    def linear(self, f: Frame, weights: np.ndarray) -> None:
        """Adds sum(weights * T) of a frame."""
        self.slope[f.of] += np.einsum("kab,ab->k", f.d, weights)
        self.curve[np.ix_(f.of, f.of)] += np.einsum("klab,ab->kl", f.dd, weights)


@dataclass
class Walk:
    """Coordinates (n,) that are used up, energy gathered, loops met."""

    x: np.ndarray
    loads: Loads
    energy: Sum
    names: list[str] = field(default_factory=list)
    """Of the coordinates, as `Solution.coordinate_names` has them."""
    loops: list[tuple[Frame, Frame]] = field(default_factory=list)

    def take(self, name: str) -> tuple[int, float]:
        self.names.append(name.removeprefix("base.").removeprefix("platform."))
        j = len(self.names) - 1
        return j, float(self.x[j])


def homogeneous(r: np.ndarray, p: Any = (0.0, 0.0, 0.0)) -> np.ndarray:
    out = np.zeros((4, 4))
    out[:3, :3], out[:3, 3], out[3, 3] = r, p, 1.0
    return out


def pushed(f: Frame, axis: Any, home: float, number: int, value: float) -> Frame:
    """Behind a translation along a unit axis."""
    d = np.zeros((4, 4))
    d[:3, 3] = axis
    return f.moved(number, homogeneous(np.eye(3), (home + value) * np.array(axis)), d, np.zeros((4, 4)))


@lru_cache(maxsize=4096)
def about(axis: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Homogeneous: axis x, and its square."""
    s = np.tensordot(np.array(axis), CROSS, axes=1)
    out = np.zeros((2, 4, 4))
    out[0, :3, :3], out[1, :3, :3] = s, s @ s
    return out[0], out[1]


def turned(f: Frame, axis: Any, home: float, number: int, value: float) -> Frame:
    """Behind a rotation about a unit axis (Rodrigues)."""
    s, ss = about(tuple(axis))
    sin, cos = np.sin(home + value), np.cos(home + value)
    return f.moved(number, EYE + sin * s + (1 - cos) * ss, cos * s + sin * ss, -sin * s + cos * ss)


def at_point(offset: Any, force: Any) -> np.ndarray:
    """Weights of a frame's matrix whose sum is force . (position of the point)."""
    out = np.zeros((4, 4))
    out[:3] = np.outer(force, [*offset, 1.0])
    return out


def along(elements: Any, f: Frame, walk: Walk, name: str) -> Frame:
    """Frame behind a sequence; energy and loops go to `walk`."""
    for e in elements:
        if isinstance(e, Offset):
            t = e.actual or e.nominal
            f = f.fixed(homogeneous(np.array(t.r), t.p))
        elif isinstance(e, Joint):
            f = through_joint(e, f, walk, f"{name}.{e.name}")
        elif isinstance(e, Spring):
            f = through_spring(e, f, walk, f"{name}.{e.name}")
        elif isinstance(e, Body):
            walk.energy.linear(f, at_point(e.com, -e.mass * walk.loads.gravity))
        elif isinstance(e, Point):
            force = walk.loads.at_points.get(f"{name}.{e.name}")
            if force is not None:
                walk.energy.linear(f, at_point(e.offset, -force))
        elif isinstance(e, Block):
            ends = [along(b.elements, f, walk, f"{name}.{b.name}") for b in e.branches]
            walk.loops += [(ends[0], end) for end in ends[1:]]
            f = ends[0]
    return f


def through_joint(e: Joint, f: Frame, walk: Walk, name: str) -> Frame:
    laws = e.axis_laws or (e.law,) * len(e.axes)
    for i, (axis, home, law, rest) in enumerate(zip(e.axes, e.home, laws, e.rest or e.home, strict=True)):
        if e.actuated and law is None:
            m = np.eye(4)
            if e.kind == "prismatic":
                m[:3, 3] = home * np.array(axis)
            else:
                m = turned(Frame.base(), axis, home, 0, 0.0).t
            f = f.fixed(m)
            continue
        j, a = walk.take(name if len(e.axes) == 1 else f"{name}.{i + 1}")
        if law is not None:
            d = a + (home - rest)
            walk.energy.slope[j] += law.stiffness * d + law.cubic * d**3
            walk.energy.curve[j, j] += law.stiffness + 3 * law.cubic * d**2
        f = (pushed if e.kind == "prismatic" else turned)(f, axis, home, j, a)
    return f


def through_spring(e: Spring, f: Frame, walk: Walk, name: str) -> Frame:
    """Translation, then rotations about x, y and z in sequence."""
    taken = [walk.take(f"{name}.{c}") for c in ("tx", "ty", "tz", "rx", "ry", "rz")]
    of, k = [j for j, _ in taken], np.array(e.stiffness)
    walk.energy.slope[of] += k @ (np.array([a for _, a in taken]) - np.array(e.rest))
    walk.energy.curve[np.ix_(of, of)] += k
    for i, (j, a) in enumerate(taken):
        f = (pushed if i < 3 else turned)(f, UNITS[i % 3], 0.0, j, a)
    return f


def whole(d: MachineDescription, x: np.ndarray, loads: Loads) -> tuple[Frame, Walk]:
    """Frame of the tip, and what the walk gathered."""
    walk = Walk(x, loads, Sum(np.zeros(len(x)), np.zeros((len(x), len(x)))))
    start = along(d.base, Frame.base(), walk, "base")
    ends = [along(leg.elements, start, walk, leg.name) for leg in d.legs]
    walk.loops += [(ends[0], end) for end in ends[1:]]
    tip = along(d.platform, ends[0], walk, "platform")
    walk.energy.linear(tip, at_point((0, 0, 0), -loads.force))
    tilt = np.zeros((4, 4))
    tilt[:3, :3] = np.tensordot(loads.moment, CROSS, axes=1) @ np.array(d.home.r)
    walk.energy.linear(tip, -tilt / 2)
    return tip, walk


AXIAL = np.zeros((3, 3, 3))  # AXIAL[i] . q = q[k, j] - q[j, k]
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    AXIAL[_i, _k, _j], AXIAL[_i, _j, _k] = 1.0, -1.0


def gap(a: Frame, b: Frame, multipliers: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Closure (6,) of a loop: difference of positions, and axial part of Ra^T Rb; its Jacobian (6, n); and
    the Hessian (n, n) of multipliers . closure."""
    value, rows, curve = np.zeros(6), np.zeros((6, n)), np.zeros((n, n))
    value[:3] = b.t[:3, 3] - a.t[:3, 3]
    for f, sign in ((b, 1.0), (a, -1.0)):
        rows[:3, f.of] += sign * f.d[:, :3, 3].T
        curve[np.ix_(f.of, f.of)] += sign * f.dd[:, :, :3, 3] @ multipliers[:3]
    ra, rb, m = a.t[:3, :3], b.t[:3, :3], np.tensordot(multipliers[3:], AXIAL, axes=1)
    da, db = a.d[:, :3, :3], b.d[:, :3, :3]
    value[3:] = np.einsum("iab,ca,cb->i", AXIAL, ra, rb)
    rows[3:, a.of] += np.einsum("iab,kca,cb->ik", AXIAL, da, rb, optimize=True)
    rows[3:, b.of] += np.einsum("iab,ca,kcb->ik", AXIAL, ra, db, optimize=True)
    # sum(m * Ra^T Rb) = sum(Ra * Rb m^T) = sum(Rb * Ra m)
    curve[np.ix_(a.of, a.of)] += np.einsum("klab,ab->kl", a.dd[:, :, :3, :3], rb @ m.T)
    curve[np.ix_(b.of, b.of)] += np.einsum("klab,ab->kl", b.dd[:, :, :3, :3], ra @ m)
    both = np.einsum("kab,lab->kl", da @ m, db)
    curve[np.ix_(a.of, b.of)] += both
    curve[np.ix_(b.of, a.of)] += both.T
    return value, rows, curve
