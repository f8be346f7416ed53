"""Random elements: offsets with errors, joints of every kind and chart, elastic and free, springs, blocks."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.model.description import Block, Body, Branch, Element, Joint, Law, Offset, Point, Pose, Spring

AXES = {"revolute": 1, "prismatic": 1, "universal": 2, "spherical": 3}


class Parts:
    """Every number is drawn from one seeded stream, so that a seed names a machine."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.aside = np.random.default_rng(
            (seed, 1)
        )  # what was thought of later: the machines keep their seeds

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

    def _spring(self, name: str, softer: float = 1.0) -> Spring:
        """Fully coupled; `softer`: by this factor."""
        size = np.r_[[1e3] * 3, [150.0] * 3] * self.rng.uniform(0.5, 2) / softer**0.5
        a = self.rng.normal(size=(6, 6))
        k = size[:, None] * (a @ a.T / 6 + 0.3 * np.eye(6)) * size
        rest = self.rng.normal(scale=2e-5, size=6) if self.rng.random() < 0.2 else np.zeros(6)
        return replace(self._matrix(name, (k + k.T) / 2), rest=tuple(rest.tolist()))

    def _matrix(self, name: str, stiffness: np.ndarray) -> Spring:
        return Spring(name, stiffness=tuple(map(tuple, stiffness.tolist())))

    def _joint(self, name: str, kind: str) -> Joint:
        n = AXES[kind]
        axes = [np.array(self._axis()) for _ in range(n)]
        home = self.rng.uniform(-0.4, 0.4, n)
        if n > 1:  # consecutive axes at right angles; the third is another one, or the first again
            axes = list(Rotation.random(random_state=self.rng).as_matrix()[:n])
        if n == 3 and self.rng.random() < 0.5:
            axes[2] = axes[0]
            home[1] = self.rng.choice([-1, 1]) * self.rng.uniform(0.4, 1.4)
        out = self._passive(name, kind, tuple((float(a[0]), float(a[1]), float(a[2])) for a in axes), home)
        if (
            n == 3 and out.free and self.rng.random() < 0.2
        ):  # axes that lock at home number its rotations as well
            return replace(out, axes=(out.axes[0], out.axes[1], out.axes[0]), home=(home[0], 0.0, home[2]))
        return out

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
