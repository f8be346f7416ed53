"""A description as bodies and pairs of frames between them. What ends in one frame is one body: the ends of all legs
and the start of the platform, the ends of all branches of a block."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.model.description import (
    Block,
    Body,
    Cable,
    Joint,
    Law,
    MachineDescription,
    Offset,
    Point,
    Spring,
)

from . import measures as made
from .measures import Measure, Measures
from .relative import Array, Frames, State

BASE = -1


class Unsupported(Exception):
    """The description holds what this formulation does not know."""


@dataclass
class At:
    """A frame on a body."""

    body: int
    r: Array = field(default_factory=lambda: np.eye(3))
    p: Array = field(default_factory=lambda: np.zeros(3))

    def behind(self, r: Array, p: Array) -> At:
        return At(self.body, self.r @ r, self.p + self.r @ p)


@dataclass
class Pair:
    """Two frames, the measures between them, what each is for."""

    name: str
    leg: str
    a: At
    b: At
    measures: list[Measure]
    roles: list[str]
    """keep: always zero; joint: an axis of a joint; spring: a direction of a spring."""
    element: Any = None
    axis: int = 0


@dataclass(frozen=True)
class Mass:
    leg: str
    at: At
    body: Body


@dataclass
class Structure:
    """Bodies 0 ... n - 1; BASE is the base. The TCP is the frame of body `tip` itself."""

    d: MachineDescription
    pairs: list[Pair]
    masses: list[Mass]
    points: dict[str, tuple[str, At]]
    cables: list[tuple[str, str, At, Cable]]
    """Full name, leg, frame that it starts from."""
    tip: int
    platform: int
    """The body in which the legs end."""
    start: State
    """As drawn, at the declared coordinates, springs at rest."""
    frames: tuple[Frames, Frames]
    measures: Measures
    names: list[str]
    """Full name of the joint's axis, or the spring's direction, of each measure; empty for those that are kept."""
    home: Array
    """Declared coordinates of each measure."""

    @property
    def size(self) -> int:
        return len(self.start.p) - 1

    def where(self, role: str) -> list[int]:
        """Numbers of the measures of a role."""
        roles = [r for p in self.pairs for r in p.roles]
        return [i for i, r in enumerate(roles) if r == role]


class Builder:
    """Walks the description once."""

    def __init__(self, d: MachineDescription, beside: dict[str, Array] | None = None) -> None:
        """`beside`: the machine as built, and how far (3,) each guide carries beside its line; None: as drawn."""
        self.d, self.as_built, self.beside = d, beside is not None, beside or {}
        self.pairs: list[Pair] = []
        self.masses: list[Mass] = []
        self.points: dict[str, tuple[str, At]] = {}
        self.cables: list[tuple[str, str, At, Cable]] = []
        self.poses: list[tuple[Array, Array]] = []
        self.same: dict[int, At] = {}  # body -> where it stands on the body that it is part of
        self.leg = ""
        self.end = At(BASE)

    def build(self) -> Structure:
        start = self.along(self.d.base, At(BASE), "")
        self.leg = self.d.legs[0].name if self.d.legs else ""
        ends: list[At] = []
        for leg in self.d.legs:
            self.leg = leg.name
            ends.append(self.leg_or_branch(leg.elements, start, f"{leg.name}.", ends[0] if ends else None))
        self.leg = ""
        self.end = ends[0] if ends else self.hung() if self.d.freedoms and not self.d.legs else start
        tip = self.along(self.d.platform, self.end, "")
        tip = self.now(tip)
        if tip.body == BASE:  # held by nothing but itself
            self.leg = self.d.legs[-1].name if self.d.legs else ""
            self.new(
                tip, np.eye(3), np.zeros(3), Pair("rigid", self.leg, tip, tip, made.weld(), ["keep"] * 6)
            )
            tip = self.end = At(len(self.poses) - 1)
        return self.finished(tip)

    def hung(self) -> At:
        """The platform of a machine without legs, where the TCP is at home; guides hold what is no freedom."""
        own = Builder(replace(self.d, legs=()), None)
        own.poses.append((np.eye(3), np.zeros(3)))
        end = own.along(self.d.platform, At(0), "")
        r = np.array(self.d.home.r) @ own.pose(end)[0].T
        p = np.array(self.d.home.p) - r @ own.pose(end)[1]
        self.poses.append((r, p))
        turning = [i for i, n in enumerate(("rx", "ry", "rz")) if n in self.d.freedoms]
        kept = [made.linear(shift=np.eye(3)[i]) for i, n in enumerate("xyz") if n not in self.d.freedoms]
        if len(turning) == 2:
            raise Unsupported("a platform that turns about two axes")
        if not turning:
            kept += made.weld()[:3]
        if len(turning) == 1:
            axis = np.eye(3)[turning[0]]
            kept += [made.linear(np.outer(v, axis)) for v in made.across(axis)]
        if kept:
            body = At(len(self.poses) - 1, r.T, np.zeros(3))
            self.pair(Pair("guides", "", At(BASE, np.eye(3), p), body, kept, ["keep"] * len(kept)))
        return At(len(self.poses) - 1)

    def leg_or_branch(self, elements: Iterable[Any], start: At, prefix: str, end: At | None) -> At:
        """Its end; where others have ended already, that is made one with their end."""
        before = len(self.poses)
        here = self.along(elements, start, prefix)
        if end is None:
            return here
        if here.body >= before and here.body not in self.same:
            turn = self.now(end).r @ here.r.T
            target = self.now(end)
            self.same[here.body] = At(target.body, turn, target.p - turn @ here.p)
        else:
            self.pair(Pair(f"{prefix}end", self.leg, here, end, made.weld(), ["keep"] * 6))
        return end

    def now(self, at: At) -> At:
        """The same frame on the body that stands for others."""
        while at.body in self.same:
            on = self.same[at.body]
            at = At(on.body, on.r @ at.r, on.p + on.r @ at.p)
        return at

    def pair(self, p: Pair) -> None:
        self.pairs.append(p)

    def along(self, elements: Iterable[Any], f: At, prefix: str) -> At:
        for e in elements:
            name = prefix + e.name
            if isinstance(e, Offset):
                t = e.actual if e.actual is not None and self.as_built else e.nominal
                f = f.behind(np.array(t.r), np.array(t.p))
            elif isinstance(e, Cable):
                self.cables.append((name, self.leg, f, e))
            elif isinstance(e, Joint):
                f = self.joint(e, f, name)
            elif isinstance(e, Spring):
                roles = ["spring"] * 6
                f = self.new(f, np.eye(3), np.zeros(3), Pair(name, self.leg, f, f, made.spring(), roles, e))
            elif isinstance(e, Body):
                self.masses.append(Mass(self.leg, f, e))
            elif isinstance(e, Point):
                self.points[name] = (self.leg, f.behind(np.eye(3), np.array(e.offset)))
            elif isinstance(e, Block):
                end: At | None = None
                for b in e.branches:
                    end = self.leg_or_branch(b.elements, f, f"{prefix}{b.name}.", end)
                assert end is not None
                f = end
            else:
                raise Unsupported(type(e).__name__)
        return f

    def new(self, f: At, r: Array, p: Array, pair: Pair) -> At:
        """A body behind a pair, turned and moved by r and p at home."""
        rf, pf = self.pose(f)
        self.poses.append((rf @ r, pf + rf @ p))
        pair.b = At(len(self.poses) - 1)
        self.pair(pair)
        return pair.b

    def pose(self, f: At) -> tuple[Array, Array]:
        if f.body == BASE:
            return f.r, f.p
        r, p = self.poses[f.body]
        return r @ f.r, p + r @ f.p

    def joint(self, e: Joint, f: At, name: str) -> At:
        if e.friction is not None:
            raise Unsupported("friction of a joint")
        f = f.behind(np.eye(3), self.beside.get(name, np.zeros(3)))
        axes = [np.array(a) for a in e.axes]
        if e.free and e.kind in ("universal", "spherical"):
            turn = np.eye(3)
            for a, q in zip(axes, e.home, strict=True):
                turn = turn @ Rotation.from_rotvec(q * a).as_matrix()
            kept = made.ball() if e.kind == "spherical" else made.cardan(*axes)
            return self.new(f, turn, np.zeros(3), Pair(name, self.leg, f, f, kept, ["keep"] * len(kept), e))
        for i, (a, q) in enumerate(zip(axes, e.home, strict=True)):
            kept, own = (made.slide if e.kind == "prismatic" else made.hinge)(a)
            turn, shift = np.eye(3), np.zeros(3)
            if e.kind == "prismatic":
                shift = q * a
            else:
                turn = Rotation.from_rotvec(q * a).as_matrix()
            full = name if len(axes) == 1 else f"{name}.{i + 1}"
            roles = ["keep"] * len(kept) + ["joint"]
            f = self.new(f, turn, shift, Pair(full, self.leg, f, f, [*kept, own], roles, e, i))
        return f

    def finished(self, tip: At) -> Structure:
        """Bodies that are parts of others are gone; the tip's frame is its body's own."""
        self.same[tip.body] = At(len(self.poses), tip.r.T, -tip.r.T @ tip.p)
        self.poses.append(self.pose(tip))
        kept = [b for b in range(len(self.poses)) if b not in self.same]
        number = {b: i for i, b in enumerate(kept)} | {BASE: len(kept)}

        def final(at: At) -> At:
            at = self.now(at)
            return At(number[at.body], at.r, at.p)

        for p in self.pairs:
            p.a, p.b = final(p.a), final(p.b)
        masses = [Mass(m.leg, final(m.at), m.body) for m in self.masses]
        points = {n: (leg, final(at)) for n, (leg, at) in self.points.items()}
        cables = [(n, leg, final(at), e) for n, leg, at, e in self.cables]
        names: list[str] = []
        home: list[float] = []
        of: list[int] = []
        sine_of: list[int] = []
        for i, p in enumerate(self.pairs):
            first = len(of)
            for k, (m, role) in enumerate(zip(p.measures, p.roles, strict=True)):
                of.append(i)
                in_spring = role == "spring" and m.kind == made.ANGLE
                sine_of.append(first + 4 if in_spring else -1)
                part = [".tx", ".ty", ".tz", ".rx", ".ry", ".rz"][k] if role == "spring" else ""
                names.append("" if role == "keep" else p.name + part)
                home.append(p.element.home[p.axis] if role == "joint" else 0.0)
        poses = [self.poses[b] for b in kept] + [(np.eye(3), np.zeros(3))]
        start = State(np.array([p for _, p in poses]), np.array([r for r, _ in poses]))
        all_measures = Measures([m for p in self.pairs for m in p.measures], of, sine_of)
        return Structure(
            self.d, self.pairs, masses, points, cables, number[len(self.poses) - 1], final(self.end).body, start,
            (frames([p.a for p in self.pairs]), frames([p.b for p in self.pairs])),
            all_measures, names, np.array(home, dtype=float),
        )  # fmt: skip


def frames(at: list[At]) -> Frames:
    return Frames(
        np.array([f.body for f in at], dtype=int),
        np.array([f.r for f in at]).reshape(-1, 3, 3),
        np.array([f.p for f in at]).reshape(-1, 3),
    )


def law_at(law: Law, a: float, soft: float = 1.0) -> tuple[float, float]:
    """Force and slope at a deflection, the compliance being `soft` times as large. Knots of a polyline stay."""
    if law.friction:
        raise Unsupported("dry friction")
    if not law.knots:
        return law.stiffness / soft * a + law.cubic * a**3, law.stiffness / soft + 3 * law.cubic * a**2
    x, y = np.array(law.knots).T
    if (np.diff(x) <= 0).any():
        raise Unsupported("a step of a law")
    if a < x[0]:
        return float(y[0] + law.stiffness / soft * (a - x[0])), law.stiffness / soft
    if a >= x[-1]:
        return float(y[-1] + law.stiffness / soft * (a - x[-1])), law.stiffness / soft
    i = int(np.searchsorted(x, a, side="right")) - 1
    k = (y[i + 1] - y[i]) / (x[i + 1] - x[i])
    return float(y[i] + k * (a - x[i])), float(k)
