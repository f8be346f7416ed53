"""Random machines that close at home: legs, nested blocks, joints of every kind and chart, elastic and free,
springs, laws, bodies, points, errors, preload; crooked hexapods; and random loads on them, far beyond what
some of them bear."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.description import (
    Block,
    Body,
    Branch,
    Element,
    Joint,
    Law,
    Leg,
    MachineDescription,
    Offset,
    Point,
    Pose,
    Spring,
)
from stiffmap.description.tree import point_names

from .energy import Loads

AXES = {"revolute": 1, "prismatic": 1, "universal": 2, "spherical": 3}
GRAVITY = np.array([0.0, 0.0, -9.81])


class Generator:
    """Every number is drawn from one seeded stream, so that a seed names a machine."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)

    def machine(self) -> MachineDescription:
        """A crooked hexapod, or two or three legs that all end in one random platform pose."""
        if self.rng.random() < 0.3:
            return self._hexapod()
        home = self._pose(0.6)
        legs = tuple(Leg(f"leg{i}", self._leg(home)) for i in range(self.rng.integers(2, 4)))
        platform: tuple[Element, ...] = (Body("platform", float(self.rng.uniform(1, 8)), self._vector(0.1)),)
        if self.rng.random() < 0.4:
            platform = (self._spring("tool"), *platform)
        return MachineDescription("random", legs, platform=platform, home=home)

    def _hexapod(self) -> MachineDescription:
        """Six legs universal - prismatic drive - spherical between uneven circles, every axis askew."""
        tilt = Rotation.from_rotvec(self.rng.uniform(-0.3, 0.3, 3)).as_matrix()
        home = Pose.of((*self.rng.uniform(-0.1, 0.1, 2), self.rng.uniform(0.5, 0.8)), tilt)
        legs = []
        for i in range(6):
            pair = 2 * np.pi * (i // 2) / 3
            low = pair + (0.25 if i % 2 else -0.25) + self.rng.normal(scale=0.1)
            high = pair + (0.8 if i % 2 else -0.8) + self.rng.normal(scale=0.1)
            foot = self.rng.uniform(0.4, 0.6) * np.array([np.cos(low), np.sin(low), 0.0])
            head = self.rng.uniform(0.2, 0.3) * np.array([np.cos(high), np.sin(high), 0.0])
            legs.append(Leg(f"leg{i}", self._strut(home, foot, np.array(home.p) + np.array(home.r) @ head)))
        platform = (Body("platform", float(self.rng.uniform(1, 8)), self._vector(0.1)),)
        return MachineDescription("random", tuple(legs), platform=platform, home=home)

    def _strut(self, home: Pose, foot: np.ndarray, head: np.ndarray) -> tuple[Element, ...]:
        x = (head - foot) / np.linalg.norm(head - foot)
        y = np.cross(self.rng.normal(size=3), x)
        y /= np.linalg.norm(y)
        frame = np.column_stack([x, y, np.cross(x, y)])
        crook = Rotation.from_rotvec(self.rng.uniform(-0.2, 0.2, 3)).as_matrix()
        out: list[Element] = [Offset("foot", Pose.of(foot, frame @ crook))]
        out += [
            self._passive("cardan", "universal", ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0))),
            self._offset("crook"),
        ]
        along = np.array(end_of(out).r).T @ x
        law = Law(float(self.rng.uniform(2e6, 2e7)))
        axis = (float(along[0]), float(along[1]), float(along[2]))
        out += [Joint("drive", "prismatic", (axis,), (0.2,), actuated=True, law=law), self._spring("rod")]
        out += (
            [Body("rod", float(self.rng.uniform(0.5, 4)), self._vector(0.1))]
            if self.rng.random() < 0.5
            else []
        )
        turn = np.array(end_of(out).r).T @ Rotation.random(random_state=self.rng).as_matrix()
        out.append(Offset("reach", end_of(out).inverse() @ Pose.of(head, np.array(end_of(out).r) @ turn)))
        out.append(self._joint("ball", "spherical"))
        return (*out, Offset("attach", end_of(out).inverse() @ home))

    def _vector(self, size: float) -> tuple[float, float, float]:
        x, y, z = self.rng.uniform(-size, size, 3)
        return (float(x), float(y), float(z))

    def _axis(self) -> tuple[float, float, float]:
        v = self.rng.normal(size=3)
        x, y, z = v / np.linalg.norm(v)
        return (float(x), float(y), float(z))

    def _pose(self, size: float) -> Pose:
        return Pose.of(self._vector(size), Rotation.random(random_state=self.rng).as_matrix())

    def _offset(self, name: str) -> Offset:
        nominal = self._pose(0.3)
        if self.rng.random() < 0.3:
            small = Rotation.from_rotvec(self.rng.normal(scale=2e-4, size=3)).as_matrix()
            return Offset(name, nominal, nominal @ Pose.of(self.rng.normal(scale=5e-5, size=3), small))
        return Offset(name, nominal)

    def _spring(self, name: str) -> Spring:
        size = np.r_[[1e3] * 3, [150.0] * 3] * self.rng.uniform(0.5, 2)
        a = self.rng.normal(size=(6, 6))
        k = size[:, None] * (a @ a.T / 6 + 0.3 * np.eye(6)) * size
        rest = self.rng.normal(scale=2e-5, size=6) if self.rng.random() < 0.2 else np.zeros(6)
        k = (k + k.T) / 2
        return Spring(name, stiffness=tuple(map(tuple, k.tolist())), rest=tuple(rest.tolist()))

    def loads(self, description: MachineDescription) -> Loads:
        """Force at the tip, forces at most points; in half of the cases gravity, in a third a semitangential
        moment (which the fast path leaves to the reference path)."""
        force, moment = self.rng.normal(size=3) * 300, self.rng.normal(size=3) * 15
        moment = moment if self.rng.random() < 1 / 3 else np.zeros(3)
        gravity = GRAVITY if self.rng.random() < 0.5 else np.zeros(3)
        named = [n for n in point_names(description) if self.rng.random() < 0.7]
        factor = float(self.rng.choice([1.0, 1.0, 10.0, 100.0]))
        at = {n: factor * self.rng.normal(size=3) * 100 for n in named}
        return Loads(factor * force, factor * moment, gravity, at)

    def _joint(self, name: str, kind: str) -> Joint:
        n = AXES[kind]
        axes = [np.array(self._axis()) for _ in range(n)]
        home = self.rng.uniform(-0.4, 0.4, n)
        if n > 1:  # consecutive axes at right angles; the third is another one, or the first again
            axes = list(Rotation.random(random_state=self.rng).as_matrix()[:n])
        if n == 3 and self.rng.random() < 0.5:
            axes[2] = axes[0]
            home[1] = self.rng.choice([-1, 1]) * self.rng.uniform(0.4, 1.4)
        return self._passive(name, kind, tuple((float(a[0]), float(a[1]), float(a[2])) for a in axes), home)

    def _passive(
        self, name: str, kind: str, axes: tuple[tuple[float, float, float], ...], home: Any = None
    ) -> Joint:
        """Free, or elastic about (along) each of its axes."""
        at = self.rng.uniform(-0.4, 0.4, len(axes)) if home is None else home
        law = None
        if self.rng.random() < 0.35:
            law = Law(
                float(10 ** self.rng.uniform(4, 7) if kind == "prismatic" else 10 ** self.rng.uniform(1, 4))
            )
        return Joint(name, kind, axes, tuple(float(v) for v in at), law=law)

    def _joints(self, freedoms: int) -> list[str]:
        """Kinds of passive joints with so many freedoms together."""
        if freedoms == 3 and self.rng.random() < 0.3:
            return ["spherical"]
        if freedoms >= 2 and self.rng.random() < 0.3:
            return ["universal", *self._joints(freedoms - 2)]
        return ["revolute" if self.rng.random() < 0.75 else "prismatic" for _ in range(freedoms)]

    def _drive(self, name: str) -> Joint:
        cubic = 1e14 if self.rng.random() < 0.3 else 0.0
        law = Law(float(self.rng.uniform(2e6, 2e7)), cubic)
        return Joint(name, "prismatic", (self._axis(),), (0.2,), actuated=True, law=law)

    def _leg(self, target: Pose) -> tuple[Element, ...]:
        out: list[Element] = [self._offset("start")]
        parts = ["drive", "spring", *self._joints(int(self.rng.integers(1, 4)))]
        parts += ["spring"] if self.rng.random() < 0.5 else []
        parts += ["block"] if self.rng.random() < 0.5 else []
        parts += ["body"] if self.rng.random() < 0.5 else []
        parts += ["point"] if self.rng.random() < 0.4 else []
        for i, part in enumerate(self.rng.permutation(parts)):
            out += [self._element(str(part), f"{part}{i}"), self._offset(f"link{i}")]
        return (*out, Offset("attach", end_of(out).inverse() @ target))

    def _element(self, part: str, name: str) -> Element:
        if part == "body":
            return Body(name, float(self.rng.uniform(0.5, 4)), self._vector(0.1))
        if part == "point":
            return Point(name, self._vector(0.1))
        if part in AXES:
            return self._joint(name, part)
        return {"drive": self._drive, "spring": self._spring, "block": self._block}[part](name)

    def _block(self, name: str) -> Block:
        end = self._pose(0.3)
        branches = []
        for i in range(2):
            inner: list[Element] = [self._offset("in"), self._spring("bar")]
            if self.rng.random() < 0.6:
                inner.insert(1, self._joint("pin", "revolute"))
            inner.append(Offset("out", end_of(inner).inverse() @ end))
            branches.append(Branch(f"{name}_{i}", tuple(inner)))
        return Block(name, tuple(branches))


def end_of(elements: list[Element]) -> Pose:
    """Nominal frame behind a sequence at home, springs at rest."""
    at = Pose()
    for e in elements:
        if isinstance(e, Offset):
            at = at @ e.nominal
        elif isinstance(e, Joint):
            for axis, q in zip(e.axes, e.home, strict=True):
                if e.kind == "prismatic":
                    at = at @ Pose.of(q * np.array(axis))
                else:
                    at = at @ Pose.of((0, 0, 0), Rotation.from_rotvec(q * np.array(axis)).as_matrix())
        elif isinstance(e, Block):
            at = at @ end_of(list(e.branches[0].elements))
    return at
