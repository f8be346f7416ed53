"""Random machines of leaf springs without joints, of cables that only pull, of springs outside the legs, and with balls
near their locks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import lsq_linear

from stiffmap.model.description import (
    Body,
    Cable,
    CommandError,
    Element,
    ExternalSpring,
    Joint,
    Law,
    Leg,
    MachineDescription,
    Offset,
    Point,
    Pose,
)

from .generate import X, Y, Z
from .parts import end_of
from .tasks import NONE, Asking, Task


class Compliant(Asking):
    """One task each."""

    def leaves(self) -> Task:
        """One to three chains of beam elements between base and stage, no joint anywhere."""
        count = int(self.rng.integers(1, 4))
        home = Pose.of(self._vector(0.1), self._turn(1.0))
        legs = []
        for i in range(count):
            pieces = int(self.rng.integers(3, 9))
            length, thick = float(self.rng.uniform(0.05, 0.3)), float(10 ** self.rng.uniform(-3.5, -2.5))
            end = np.array(home.p) + np.array(home.r) @ np.array([0.0, 0.08 * (i - 1), 0.0])
            turn = np.array(home.r) @ self._turn(0.3 if count > 1 else 0.0)
            start = end - turn @ np.array([length, 0.0, 0.0])
            out: list[Element] = [Offset("clamp", Pose.of(start, turn))]
            out += self._beam(length / pieces, thick, pieces)
            out.append(Offset("attach", end_of(out).inverse() @ home))
            legs.append(Leg(f"leaf{i}", tuple(out)))
        d = MachineDescription("leaves", tuple(legs), platform=self._platform(), home=home)
        stiff = 7e10 * 0.02 * thick**3 / 12 * 3 * count / length**3
        return self._asked(
            d, None, float(stiff * length * 10 ** self.rng.uniform(-3, -0.3)), by_pose=True, heavy=0.0
        )

    def _beam(self, length: float, thick: float, pieces: int) -> list[Element]:
        """Springs of Euler's beam along x, each behind its piece."""
        e, g, width = 7e10, 2.6e10, 0.02
        area, iy, iz = width * thick, thick * width**3 / 12, width * thick**3 / 12
        c = np.diag([length / (e * area), length**3 / (3 * e * iz), length**3 / (3 * e * iy),
                     3 * length / (g * width * thick**3), length / (e * iy), length / (e * iz)])  # fmt: skip
        c[1, 5] = c[5, 1] = length**2 / (2 * e * iz)
        c[2, 4] = c[4, 2] = -(length**2) / (2 * e * iy)
        k = np.linalg.inv(c)
        out: list[Element] = []
        for i in range(pieces):
            out += [Offset(f"piece{i}", Pose.of((length, 0, 0))), self._matrix(f"bend{i}", (k + k.T) / 2)]
        return out

    def cables(self) -> Task:
        """Eight to ten cables, each a cardan, a drive that only pulls and a free ball; every other one from below."""
        count = int(self.rng.integers(8, 11))
        home = Pose.of(self.rng.uniform(-0.1, 0.1, 3) + [0, 0, 0.9], self._turn(0.1))
        ends: list[tuple[np.ndarray, np.ndarray]] = []
        while not ends or balance(home, ends)[1] > 1.0:
            ends = self._cable_ends(count)
        legs = []
        for i, ((anchor, head), tension) in enumerate(zip(ends, balance(home, ends)[0], strict=True)):
            stiff = float(10 ** self.rng.uniform(5, 6.3))
            law = Law(stiff, knots=((-0.4, -40.0), (0.0, 0.0)))
            legs.append(Leg(f"cable{i}", self._cable(home, anchor, head, law, tension / stiff)))
        d = MachineDescription("cables", tuple(legs), home=home,
                               platform=(Body("platform", float(self.rng.uniform(5, 60)), self._vector(0.05), self._inertia(2.0)),))  # fmt: skip
        shift, turn = self.rng.uniform(-0.1, 0.1, 3), self._turn(0.05)
        pose = Pose.of(np.array(home.p) + shift, turn @ np.array(home.r))
        return self._asked(d, pose, float(10 ** self.rng.uniform(1, 3.7)), by_pose=True)

    def hung(self) -> Task:
        """Six to ten cables as elements, through eyes or over pulleys, no legs: pretensioned from above and below, or
        hanging by its weight."""
        count = int(self.rng.integers(6, 11))
        home = Pose.of(self.rng.uniform(-0.1, 0.1, 3) + [0, 0, 0.9], self._turn(0.1))
        ends = self._cable_ends(count)
        pretension, left = balance(home, ends)
        above = left > 1.0  # nothing balances: all of them from above, by the weight
        cables: list[Element] = []
        for i, ((anchor, head), tension) in enumerate(zip(ends, pretension, strict=True)):
            x, y, z = (anchor + [0.0, 0.0, 1.9 - anchor[2] + 0.1 * i] if above else anchor).tolist()
            radius = float(self.rng.choice([0.0, 0.0, 0.03]))
            error = (
                (CommandError(offset=float(self.rng.normal(scale=2e-4))),) if self.rng.random() < 0.3 else ()
            )
            cables.append(
                Cable(
                    f"c{i}",
                    anchor=(x, y, z),
                    at=(float(head[0]), float(head[1]), float(head[2])),
                    guide=(0.0, 0.0, -1.0 if z > home.p[2] else 1.0),
                    elasticity=float(10 ** self.rng.uniform(4.5, 6)) if self.rng.random() < 0.8 else None,
                    stiffness=float(10 ** self.rng.uniform(5, 6))
                    if not cables or self.rng.random() < 0.5
                    else 1e6,
                    lead=float(self.rng.uniform(0, 1)),
                    pretension=0.0 if above else float(tension),
                    radius=radius,
                    command_errors=error,
                )
            )
        body = Body("platform", float(self.rng.uniform(5, 60)), self._vector(0.05), self._inertia(2.0))
        d = MachineDescription("hung", (), platform=(*cables, body), home=home)
        shift, turn = self.rng.uniform(-0.1, 0.1, 3), self._turn(0.05)
        pose = Pose.of(np.array(home.p) + shift, turn @ np.array(home.r))
        size = 20.0 if above else float(10 ** self.rng.uniform(1, 3.5))
        return self._asked(d, pose, size, by_pose=True, heavy=1.0 if above else 0.5)

    def _cable_ends(self, count: int) -> list[tuple[np.ndarray, np.ndarray]]:
        """Anchors (base axes) above and below in turn, heads (the platform's axes)."""
        out = []
        for i in range(count):
            side = 2 * np.pi * i / count + self.rng.normal(scale=0.1)
            away, low = self.rng.uniform(0.9, 1.3), i % 2 == 1
            turn = side + 0.8 * (-1) ** (i // 2)
            anchor = np.array([away * np.cos(side), away * np.sin(side), 0.05 if low else 1.9])
            out.append((anchor, np.array([0.15 * np.cos(turn), 0.15 * np.sin(turn), 0.12 if low else -0.12])))
        return out

    def _cable(
        self, home: Pose, anchor: np.ndarray, head: np.ndarray, law: Law, pull: float
    ) -> tuple[Element, ...]:
        to = np.array(home.p) + np.array(home.r) @ head
        z = (to - anchor) / np.linalg.norm(to - anchor)
        x = np.cross(self.rng.normal(size=3), z)
        x /= np.linalg.norm(x)
        frame = np.column_stack([x, np.cross(z, x), z])
        out: list[Element] = [Offset("eye", Pose.of(anchor, frame))]
        out.append(Joint("cardan", "universal", (X, Y), (0.0, 0.0)))
        out.append(Joint("winch", "prismatic", (Z,), (float(np.linalg.norm(to - anchor)),), actuated=True, law=law,
                         command_errors=(CommandError(offset=-pull),)))  # fmt: skip
        out.append(self._ball())
        return (*out, Offset("attach", end_of(out).inverse() @ home))

    def _ball(self) -> Joint:
        """A free ball, its declared axes anywhere between well apart and locked at home."""
        how = self.rng.random()
        axes = tuple(self.rng.permutation(np.eye(3)).tolist()) if how < 0.7 else (X, Y, X)
        second = float(self.rng.choice([-1, 1]) * (np.pi / 2 - 10 ** self.rng.uniform(-6, 0)))
        home = (float(self.rng.uniform(-1, 1)), second, float(self.rng.uniform(-1, 1)))
        if how < 0.4:
            home = (0.0, 0.0, 0.0)
        return Joint("ball", "spherical", tuple((a[0], a[1], a[2]) for a in axes), home)

    def locked_balls(self) -> Task:
        """Six or seven long legs with free balls whose declared axes lock at home or near it."""
        home, places = self._hexapod_places()
        legs = []
        for i, (foot, head) in enumerate(places):
            law = Law(float(self.rng.uniform(2e6, 2e7)))
            local = np.array(home.r).T @ (head - np.array(home.p))
            legs.append(
                Leg(f"leg{i}", self._cable(home, foot, local, law, float(self.rng.normal(scale=1e-5))))
            )
        d = MachineDescription("locked balls", tuple(legs), platform=self._platform(), home=home)
        pose = Pose.of(
            np.array(home.p) + self.rng.uniform(-0.04, 0.04, 3), self._turn(0.1) @ np.array(home.r)
        )
        return self._asked(d, pose, float(10 ** self.rng.uniform(1, 5)), by_pose=True)

    def outside(self) -> Task:
        """A hexapod or random legs with one to four springs between named points and anchors, some of which only pull."""
        d = self.hexapod() if self.rng.random() < 0.6 else self.random_legs()
        count = int(self.rng.integers(1, 5))
        points = tuple(Point(f"hook{i}", self._vector(0.15)) for i in range(count))
        d = replace(d, name="springs outside", platform=(*d.platform, *points))
        springs = []
        for i, point in enumerate(points):
            # hooks stand behind the platform's elements, which end at home
            at = np.array(d.home.p) + np.array(d.home.r) @ np.array(point.offset)
            anchor = at + self.rng.normal(size=3) * 0.4
            away = float(np.linalg.norm(anchor - at))
            length = away - float(self.rng.choice([0.02, 1e-4, -1e-4, -0.02]) * self.rng.uniform(0.1, 1))
            stiff = float(10 ** self.rng.uniform(3, 5.5))
            springs.append(ExternalSpring(f"rope{i}", f"platform.{point.name}", tuple(anchor.tolist()), stiff,
                                          length, bool(self.rng.random() < 0.6)))  # fmt: skip
        d = replace(d, external_springs=tuple(springs))
        loads = self.loads(replace(d, name="hexapod"))
        return Task(d, d.home, None, replace(loads, moment=NONE), "dead", True)


def balance(home: Pose, ends: list[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, float]:
    """Tensions (N) of cables between anchors (base axes) and heads (the platform's axes), within limits, and the
    largest force that they leave."""
    columns = []
    for anchor, head in ends:
        arm = np.array(home.r) @ head
        to = anchor - np.array(home.p) - arm
        u = to / np.linalg.norm(to)
        columns.append(np.r_[u, np.cross(arm, u) / 0.15])
    a = np.array(columns).T
    found = lsq_linear(a, np.zeros(6), (200.0, 1500.0)).x
    return found, float(np.abs(a @ found).max())
