"""Whether answers are equilibria: free bodies, for a batch of poses, straight from the description.

Frames by plain transforms; the virtual work of every known wrench on every coordinate; the wrenches of the loops, which
nobody knows, by least squares. What no wrench of the loops can balance is the residual. Nothing of the core is used but
the coordinates of its answer.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from stiffmap.model.description import (
    Block,
    Body,
    Joint,
    MachineDescription,
    Offset,
    Point,
    Spring,
    TableStroke,
)

from .laws import command_error, law_force
from .reactions import open_ways, unbalanced

Array = np.ndarray


@dataclass(frozen=True)
class Case:
    """What was asked of n poses; SI, base axes."""

    command: dict[str, Array]
    """Full name of each actuator -> (n,) coordinate that the controller commands."""
    turned: Array
    """(n, 3, 3) commanded rotation of the TCP."""
    force: Array
    """(n, 3) at the TCP."""
    moment: Array
    """(n, 3)."""
    gravity: Array
    """(3,)."""
    load_type: str = "dead"
    unloaded: dict[str, Array] = field(default_factory=dict)
    """Full name of each joint -> (n,) coordinate at the commanded pose, before any load."""
    smooth: dict[str, Array] = field(default_factory=dict)
    """Full name of each coordinate -> (n,) its way in linear statics without friction: friction opposes it. NaN: too
    little to tell."""
    left_open: tuple[str, ...] = ()
    """Full names of joints of which the answer says that they are open: held where they were, by whatever force."""
    at_points: dict[str, Array] = field(default_factory=dict)
    """Named point -> (3,) N, dead."""


@dataclass
class Axis:
    """A coordinate: its axis and a point on it (n, 3), base axes; the force that its spring or law asks for."""

    revolute: bool
    axis: Array
    point: Array
    force: Array | None
    """(n,): along the axis, needed to hold the coordinate where it is; a first guess where `allowed` stands; None: a
    rigid drive or a joint that is left open, whose force is a reaction."""
    allowed: tuple[Array, Array] | None = None
    """(n, k) lower and upper ends of what a law with steps or friction allows."""
    stiffness: Array | float = 0.0
    """(n,) or one: what a unit of round-off in the coordinate adds to the force."""
    value: Array | float = 0.0
    """(n,) the coordinate."""


@dataclass
class Frame:
    """Rotation (n, 3, 3), position (n, 3), numbers of the coordinates before it."""

    r: Array
    p: Array
    before: tuple[int, ...] = ()

    def of(self, at: Array) -> Frame:
        """At some of the poses."""
        return Frame(self.r[at], self.p[at], self.before)


@dataclass
class Walk:
    """What is gathered on the way."""

    d: MachineDescription
    x: dict[str, Array]
    case: Case
    as_built: bool
    axes: list[Axis] = field(default_factory=list)
    known: list[tuple[Frame, Array, Array, Array]] = field(default_factory=list)
    """Frame that bears it, point (n, 3), force (n, 3), moment (n, 3)."""
    loops: list[tuple[Frame, Frame]] = field(default_factory=list)
    points: dict[str, tuple[Frame, Array]] = field(default_factory=dict)


@dataclass(frozen=True)
class Balance:
    """Of n poses."""

    gap: Array
    """(n,) m: largest opening of a loop; angles times the machine's size."""
    residual: Array
    """(n,) N: largest force that nothing balances; moments by the machine's size."""
    scale: Array
    """(n,) N: largest force in the machine."""
    position: Array
    """(n, 3) TCP."""
    rotation: Array
    """(n, 3, 3)."""
    noise: Array
    """(n,) N: what round-off of the coordinates alone, of the machine's size, adds to a force."""
    undecided: Array
    """(n,) bool: linear statics does not say which way something rubs, so that a residual proves nothing."""


def balance(d: MachineDescription, x: dict[str, Array], case: Case, size: float) -> Balance:
    """The machine as built at coordinates `x`, under the loads of `case`."""
    walk, tip = walked(d, x, case, as_built=True)
    load(walk, tip)
    external(walk)
    residual, scale = unbalanced(walk, size)
    return Balance(gaps(walk, size), residual, scale, tip.p, tip.r, noise(walk, size), open_ways(walk))


def noise(walk: Walk, size: float) -> Array:
    """(n,) N: some units in the last place of a coordinate, times its stiffness. Where loops close, of the machine's size."""
    out = np.zeros(len(walk.case.force))
    for a in walk.axes:
        unit = np.maximum(np.abs(a.value), float(bool(walk.loops)) * (1.0 if a.revolute else size))
        out = np.maximum(
            out, 8 * np.finfo(float).eps * np.abs(a.stiffness) * unit / (size if a.revolute else 1.0)
        )
    return out


def closed(d: MachineDescription, x: dict[str, Array], case: Case, size: float) -> tuple[Array, Frame]:
    """Largest gap (n,) m of the machine as the controller knows it, and its TCP."""
    walk, tip = walked(d, x, case, as_built=False)
    return gaps(walk, size), tip


def walked(d: MachineDescription, x: dict[str, Array], case: Case, as_built: bool) -> tuple[Walk, Frame]:
    """Everything between base and TCP."""
    n = len(case.force)
    walk = Walk(d, x, case, as_built)
    start = along(walk, d.base, Frame(np.broadcast_to(np.eye(3), (n, 3, 3)), np.zeros((n, 3))), "")
    ends = [along(walk, leg.elements, start, f"{leg.name}.") for leg in d.legs]
    walk.loops += [(ends[0], end) for end in ends[1:]]
    return walk, along(walk, d.platform, ends[0], "")


def along(walk: Walk, elements: Iterable[Any], f: Frame, prefix: str) -> Frame:
    """Frame behind a sequence."""
    for e in elements:
        name = prefix + e.name
        if isinstance(e, Offset):
            t = e.actual if e.actual is not None and walk.as_built else e.nominal
            f = Frame(f.r @ np.array(t.r), f.p + f.r @ np.array(t.p), f.before)
        elif isinstance(e, Joint):
            f = through_joint(walk, e, f, name)
        elif isinstance(e, Spring):
            f = through_spring(walk, e, f, name)
        elif isinstance(e, Body):
            at = f.p + f.r @ np.array(e.com)
            weight = np.broadcast_to(e.mass * walk.case.gravity, at.shape)
            walk.known.append((f, at, weight, np.zeros_like(at)))
        elif isinstance(e, Point):
            walk.points[name] = (f, f.p + f.r @ np.array(e.offset))
        elif isinstance(e, Block):
            ends = [along(walk, b.elements, f, f"{prefix}{b.name}.") for b in e.branches]
            walk.loops += [(ends[0], end) for end in ends[1:]]
            f = ends[0]
    return f


def moved(walk: Walk, f: Frame, revolute: bool, axis: Array, value: Array, made: Axis) -> Frame:
    """Frame behind one coordinate."""
    walk.axes.append(made)
    made.value = value
    before = (*f.before, len(walk.axes) - 1)
    if not revolute:
        return Frame(f.r, f.p + value[:, None] * made.axis, before)
    x, y, z = axis
    s = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turn = np.eye(3) + np.sin(value)[:, None, None] * s + (1 - np.cos(value))[:, None, None] * (s @ s)
    return Frame(f.r @ turn, f.p, before)


def through_joint(walk: Walk, e: Joint, f: Frame, name: str) -> Frame:
    """One axis after the other; the errors of its command and of its guide."""
    laws = e.axis_laws or (e.law,) * len(e.axes)
    revolute = e.kind != "prismatic"
    for i, (axis, law) in enumerate(zip(e.axes, laws, strict=True)):
        full = name if len(e.axes) == 1 else f"{name}.{i + 1}"
        value = walk.x[full]
        column = f.r @ np.array(axis)
        made = Axis(revolute, column, f.p, None if full in walk.case.left_open else np.zeros_like(value))
        if e.actuated:
            u = walk.case.command[name]
            if walk.as_built:
                for g in e.guide_errors:
                    f = Frame(
                        f.r, f.p + command_error(g.error, u, e)[:, None] * (f.r @ np.array(g.axis)), f.before
                    )
            made.force = None
            if law is not None:
                target = u + sum(command_error(c, u, e) for c in e.command_errors) * walk.as_built
                soft = 1.0 + e.compliance_slope * (u - e.home[0])
                made.force, made.allowed = law_force(
                    law, value - target, soft, levels(walk, full, law.friction)
                )
                made.stiffness = law.stiffness / soft
        elif law is not None:
            rest = e.rest[i] if e.rest is not None else e.home[i]
            made.force, made.allowed = law_force(
                law, value - rest, np.ones_like(value), levels(walk, full, law.friction)
            )
            made.stiffness = law.stiffness
        elif e.friction is not None:
            turned = value - walk.case.unloaded.get(full, value + np.inf)
            level = e.friction.level
            made.force = 0.0 * turned
            both = levels(walk, full, level)
            made.allowed = (both, both)
            if e.friction.branch == "loading_stuck":
                made.allowed = (np.full((len(value), 1), -level), np.full((len(value), 1), level))
        f = moved(walk, f, revolute, np.array(axis), value, made)
    return f


def levels(walk: Walk, name: str, level: float) -> Array:
    """(n, 3) forces that sliding friction may add: one where its way is known, both and none where it is not."""
    out: Array = level * np.array([-1.0, 0.0, 1.0]) * np.ones((len(walk.case.force), 1))
    way = walk.case.smooth.get(name, np.full(len(out), np.nan))
    known = np.isfinite(way)
    out[known] = level * np.sign(way[known, None])
    return out


def through_spring(walk: Walk, e: Spring, f: Frame, name: str) -> Frame:
    """Translation, then rotations about x, y and z."""
    names = [f"{name}.{c}" for c in ("tx", "ty", "tz", "rx", "ry", "rz")]
    v = np.stack([walk.x[n] for n in names], -1)
    own = v - np.array(e.rest)
    free: list[int] = []
    if e.stiffness is not None:
        force = own @ np.array(e.stiffness)
        stiff = np.broadcast_to(np.diag(e.stiffness), v.shape)
    else:
        matrix = compliance(walk, e, name)
        # a rigid direction of a compliance: its force is a reaction
        free = [i for i in range(6) if not matrix[:, i].any()]
        keep = [i for i in range(6) if i not in free]
        force, stiff = np.zeros_like(v), np.zeros_like(v)
        one = matrix if e.stroke is not None else matrix[:1]
        inverse = np.linalg.inv(one[:, keep][:, :, keep])
        inverse = np.broadcast_to(inverse, (len(v), *inverse.shape[1:]))
        force[:, keep] = np.einsum("nij,nj->ni", inverse, own[:, keep])
        stiff[:, keep] = np.einsum("nii->ni", inverse)
    laws = dict(e.laws)
    basis = f.r
    for i in range(3):
        made = Axis(False, basis[:, :, i], f.p, None if i in free else force[:, i], stiffness=stiff[:, i])
        if i in laws:
            made.force, made.allowed = law_force(
                laws[i], own[:, i], np.ones(len(v)), levels(walk, names[i], laws[i].friction)
            )
        f = moved(walk, f, False, np.eye(3)[i], v[:, i], made)
    for i in range(3, 6):
        made = Axis(True, f.r[:, :, i - 3], f.p, None if i in free else force[:, i], stiffness=stiff[:, i])
        if i in laws:
            made.force, made.allowed = law_force(
                laws[i], own[:, i], np.ones(len(v)), levels(walk, names[i], laws[i].friction)
            )
        f = moved(walk, f, True, np.eye(3)[i - 3], v[:, i], made)
    return f


def compliance(walk: Walk, e: Spring, name: str) -> Array:
    """(n, 6, 6); that of a beam goes with its length: axial and torsion and bending angles with L, deflection with L^3,
    the angle by a force with L^2."""
    own, s = np.array(e.compliance), e.stroke
    if s is None:
        return np.broadcast_to(own, (len(walk.case.force), 6, 6))
    leg = name.rpartition(".")[0]
    u = next(walk.case.unloaded[n] for n in (f"{leg}.{s.joint}", s.joint) if n in walk.case.unloaded)
    if isinstance(s, TableStroke):
        rows = np.array(s.rows)
        flat = [np.interp(u, s.at, rows[:, i, j]) for i in range(6) for j in range(6)]
        return np.stack(flat, -1).reshape(-1, 6, 6)
    ratio = (s.length + s.rate * (u - s.at)) / s.length
    power = np.ones((6, 6))
    across = [i for i in range(3) if i != s.along]
    power[np.ix_(across, across)] = 3
    power[:3, 3:] = power[3:, :3] = 2
    return own * ratio[:, None, None] ** power


def load(walk: Walk, tip: Frame) -> None:
    """The wrench at the TCP as its type turns it."""
    c = walk.case
    turned = tip.r @ np.swapaxes(c.turned, 1, 2)
    f, m = c.force, c.moment
    if c.load_type == "follower":
        f, m = (np.einsum("nij,nj->ni", turned, v) for v in (f, m))
    elif c.load_type == "semitangential":
        trace = np.einsum("nii->n", turned)[:, None]
        m = 0.5 * (trace * m - np.einsum("nji,nj->ni", turned, m))
    walk.known.append((tip, tip.p, f, m))


def external(walk: Walk) -> None:
    """Forces on named points, cables and counterbalances."""
    for name, force in walk.case.at_points.items():
        f, at = walk.points[name.removeprefix("platform.").removeprefix("base.")]
        walk.known.append((f, at, np.broadcast_to(force, at.shape), np.zeros_like(at)))
    for s in walk.d.external_springs:
        f, at = walk.points[s.point.removeprefix("platform.").removeprefix("base.")]
        line = np.array(s.anchor) - at
        length = np.linalg.norm(line, axis=1)
        pull = s.stiffness * (length - s.length)
        if s.tension_only:
            pull = np.maximum(pull, 0.0)
        walk.known.append((f, at, (pull / length)[:, None] * line, np.zeros_like(at)))


def gaps(walk: Walk, size: float) -> Array:
    """(n,) m."""
    out = np.zeros(len(walk.case.force))
    for first, other in walk.loops:
        out = np.maximum(out, np.abs(other.p - first.p).max(1))
        out = np.maximum(out, size * np.abs(other.r - first.r).max((1, 2)))
    return out


def coordinates(names: Sequence[str], values: Array) -> dict[str, Array]:
    """Columns by name."""
    return {name: np.ascontiguousarray(values[:, i]) for i, name in enumerate(names)}
