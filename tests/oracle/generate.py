"""Random machines that close at home, and random loads on them, far beyond what some of them bear: legs of any
sequence, nested blocks, crooked hexapods, heavy joints before the first spring, rods that spin, arms on rails,
deltas of unlike legs, legs that are one too many."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.model.description import (
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
)
from stiffmap.model.description.tree import point_names

from .energy import Loads
from .parts import Parts, end_of

PULLED = "pulled"  # a point of a rod that spins
GRAVITY = np.array([0.0, 0.0, -9.81])
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


class Generator(Parts):
    """A machine and its loads by one seed."""

    def machine(self) -> MachineDescription:
        """Of a random family."""
        family = self.rng.random()
        if family < 0.3:
            return self.random_legs()
        if family < 0.45:
            return self.hexapod()
        if family < 0.6:
            return self.heavy_starts()
        if family < 0.72:
            return self.spinning_rods()
        if family < 0.82:
            return self.arm_on_a_rail()
        if family < 0.9:
            return self.unlike_delta()
        return self.four_legs() if family < 0.95 else self.strut()

    def random_legs(self) -> MachineDescription:
        """Two or three legs that all end in one random platform pose."""
        home = self._pose(0.6)
        legs = tuple(Leg(f"leg{i}", self._leg(home)) for i in range(self.rng.integers(2, 4)))
        platform = self._platform()
        if self.rng.random() < 0.4:
            platform = (self._spring("tool"), *platform)
        return MachineDescription("random", legs, platform=platform, home=home)

    def heavy_starts(self) -> MachineDescription:
        """Legs in which one to four passive joints and drives, in any sequence and with bodies between them, come
        before the first spring or block."""
        home = self._pose(0.6)
        legs = []
        for i in range(self.rng.integers(2, 4)):
            parts = ["drive", *self._joints(int(self.rng.integers(1, 4))), "body"]
            parts += ["body"] if self.rng.random() < 0.5 else []
            behind = ["spring", "body"] + (["block"] if self.rng.random() < 0.5 else [])
            kinds = [*self.rng.permutation(parts), *self.rng.permutation(behind)]
            legs.append(Leg(f"leg{i}", self._sequence([str(k) for k in kinds], home)))
        return MachineDescription("heavy starts", tuple(legs), platform=self._platform(), home=home)

    def hexapod(self) -> MachineDescription:
        """Six legs universal - prismatic drive - spherical between uneven circles, every axis askew."""
        home, places = self._hexapod_places()
        legs = [
            Leg(f"leg{i}", self._strut(home, foot, head, "universal"))
            for i, (foot, head) in enumerate(places)
        ]
        return MachineDescription("hexapod", tuple(legs), platform=self._platform(), home=home)

    def spinning_rods(self) -> MachineDescription:
        """A hexapod whose struts stand between two ball joints, some of them elastic, all with the centre of mass
        off the axis: what turns freely is turned by gravity."""
        home, places = self._hexapod_places()
        legs = [
            Leg(f"leg{i}", self._strut(home, foot, head, "spherical"))
            for i, (foot, head) in enumerate(places)
        ]
        return MachineDescription("spinning rods", tuple(legs), platform=self._platform(), home=home)

    def arm_on_a_rail(self) -> MachineDescription:
        """A rail, rigid or not, and five elastic revolute drives, links elastic or not, all of them heavy."""
        axes = [Z, Y, Y, X, Y]
        homes = [self.rng.uniform(-1, 1), *self.rng.uniform(0.3, 1.1, 2), *self.rng.uniform(0.3, 1.0, 2)]
        rail = Joint("rail", "prismatic", (X,), (float(self.rng.uniform(-1, 1)),), actuated=True)
        if self.rng.random() < 0.8:
            rail = replace(rail, law=Law(float(self.rng.uniform(2e6, 2e7))))
        out: list[Element] = [self._offset("floor"), rail, Body("carriage", 30.0, self._vector(0.2))]
        for i, (axis, home) in enumerate(zip(axes, homes, strict=True)):
            law = Law(float(10 ** self.rng.uniform(4.5, 6)))
            out.append(Joint(f"drive{i}", "revolute", (axis,), (float(home),), actuated=True, law=law))
            link = Rotation.from_rotvec(self.rng.normal(scale=0.02, size=3)).as_matrix()
            out.append(Offset(f"link{i}", Pose.of((*self._vector(0.05)[:2], 0.35 - 0.05 * i), link)))
            if self.rng.random() < 0.4:
                out.append(self._spring(f"elastic{i}", 30.0))
            out.append(Body(f"arm{i}", float(self.rng.uniform(1, 10)), self._vector(0.15)))
        home = end_of(out)
        return MachineDescription("arm", (Leg("arm", tuple(out)),), platform=self._platform(), home=home)

    def unlike_delta(self) -> MachineDescription:
        """Three tilted guides with carriages, each with four elastic bars of its own length and direction, parallel
        within a leg, between universal and ball joints."""
        home = Pose.of((*self.rng.uniform(-0.05, 0.05, 2), -0.6))
        legs = []
        for i in range(3):
            angle = 2 * np.pi * i / 3 + self.rng.normal(scale=0.1)
            turn = Rotation.from_euler("z", angle) * Rotation.from_rotvec(self.rng.normal(scale=0.1, size=3))
            out: list[Element] = [Offset("column", Pose.of(turn.apply((0.4, 0, 0)), turn.as_matrix()))]
            law = Law(float(self.rng.uniform(2e6, 2e7)))
            out.append(Joint("guide", "prismatic", (Z,), (0.1,), actuated=True, law=law))
            out += [self._spring("slide", 30.0)] if self.rng.random() < 0.6 else []
            out.append(Body("carriage", float(self.rng.uniform(1, 5)), self._vector(0.1)))
            out += [self._bars(out, home, i), Offset("attach", Pose())]
            out[-1] = Offset("attach", end_of(out).inverse() @ home)
            legs.append(Leg(f"leg{i}", tuple(out)))
        return MachineDescription("unlike delta", tuple(legs), platform=self._platform(), home=home)

    def _bars(self, before: list[Element], home: Pose, number: int) -> Block:
        """Four bars from the carriage, all along one vector, that end in frames turned as home."""
        at = end_of(before)
        angle = 2 * np.pi * number / 3
        to = np.array(home.p) + 0.08 * np.array([np.cos(angle), np.sin(angle), 0.0])
        bar = np.array(at.r).T @ (to - np.array(at.p))
        x = bar / np.linalg.norm(bar)
        y = np.cross(self.rng.normal(size=3), x)
        y /= np.linalg.norm(y)
        along = np.column_stack([x, y, np.cross(x, y)])
        branches = []
        for k in range(4):
            corner = np.array([0.0, 0.05 if k % 2 else -0.05, 0.03 if k // 2 else -0.03])
            corner += self.rng.normal(scale=0.01, size=3)
            inner: list[Element] = [Offset("seat", Pose.of(corner, along))]
            inner.append(self._passive("cardan", "universal", (Y, Z), (0.0, 0.0)))
            inner.append(Offset("half", Pose.of((np.linalg.norm(bar) / 2, 0, 0))))
            inner += [Body("bar", float(self.rng.uniform(0.1, 0.5)), self._vector(0.01))]
            inner += [self._spring("bar_spring", 10.0), Offset("other", inner[2].nominal)]  # type: ignore[union-attr]
            inner.append(self._joint("ball", "spherical"))
            end = Pose.of(bar)
            inner.append(Offset("out", end_of(inner).inverse() @ end))
            branches.append(Branch(f"bar{k}", tuple(inner)))
        return Block("bars", tuple(branches))

    def four_legs(self) -> MachineDescription:
        """A plane machine with three degrees of freedom on four legs, one of them of another kind: one drive and
        every motion out of the plane too many."""
        tilt = Rotation.random(random_state=self.rng).as_matrix()
        home = Pose.of(self._vector(0.3), tilt)
        legs = []
        for i in range(4):
            angle = np.pi / 2 * i + self.rng.normal(scale=0.2)
            out: list[Element] = [
                Offset("foot", home @ Pose.of((0.5 * np.cos(angle), 0.5 * np.sin(angle), 0.0)))
            ]
            law = Law(float(self.rng.uniform(2e6, 2e7)))
            slide = self.rng.normal(size=2)
            axis = (*(float(v) for v in slide / np.linalg.norm(slide)), 0.0)
            out.append(Joint("drive", "prismatic", (axis,), (0.2,), actuated=True, law=law))
            out += [Body("carriage", float(self.rng.uniform(1, 5)), self._vector(0.1))]
            odd = i == 3
            first, second = (
                (("revolute", Z), ("prismatic", X if odd else Y)) if odd else (("revolute", Z),) * 2
            )
            out += [self._spring("root", 30.0)] if self.rng.random() < 0.5 else []
            out.append(self._passive("first", first[0], (first[1],)))
            out.append(Offset("link", Pose.of((*self.rng.uniform(0.15, 0.3, 2), 0.0))))
            out.append(self._spring("elastic", 10.0))
            out.append(self._passive("second", second[0], (second[1],)))
            out.append(Offset("beyond", Pose.of((*self.rng.uniform(0.1, 0.2, 2), 0.0))))
            if odd:
                out.append(self._passive("third", "revolute", (Z,)))
            out.append(Offset("attach", end_of(out).inverse() @ home))
            legs.append(Leg(f"leg{i}", tuple(out)))
        return MachineDescription("four legs", tuple(legs), platform=self._platform(), home=home)

    def strut(self) -> MachineDescription:
        """A strut upright on its elastic root (a spring, a universal joint, two hinges), that a second leg holds
        sideways, a little or a million times as much: under a thrust it buckles, or does not."""
        length, root = float(self.rng.uniform(0.3, 0.8)), float(10 ** self.rng.uniform(2, 4))
        sideways = float(self.rng.choice([1.0, root / length**2, 1e8]) * self.rng.uniform(0.1, 2))
        stiff, law = np.diag([1e7] * 3 + [1e6] * 3), Law(root)
        how = self.rng.integers(3)
        column: list[Element]
        if how == 0:
            column = [self._matrix("root", np.diag([1e7, 1e7, 1e7, root, root, 1e6]))]
        else:
            column = [self._matrix("foot", stiff)]
            column += [Joint("root", "universal", (X, Y), (0.0, 0.0), law=law)] if how == 1 else []
            hinges = [Joint(f"hinge{i}", "revolute", (a,), (0.0,), law=law) for i, a in enumerate((X, Y))]
            column += hinges if how == 2 else []
        column += [Offset("strut", Pose.of((0, 0, length))), Joint("top", "universal", (X, Y), (0.0, 0.0))]
        guide: list[Element] = [
            Offset("up", Pose.of((0, 0, length))),
            self._matrix("guide", np.diag([sideways, sideways, 1e7, 1e6, 1e6, 1e6])),
            Joint("free", "prismatic", (Z,), (0.0,)),
        ]
        base = Offset("turn", Pose.of((0, 0, 0), Rotation.random(random_state=self.rng).as_matrix()))
        home = base.nominal @ Pose.of((0, 0, length))
        self.thrust = (root / length**2 + sideways) * length
        if sideways > 1e6:
            self.thrust = root / length
        legs = (Leg("strut", tuple(column)), Leg("guide", tuple(guide)))
        return MachineDescription("strut", legs, base=(base,), home=home)

    def loads(self, description: MachineDescription) -> Loads:
        """Force at the tip, forces at most points (of rods that spin as well); in half of the cases gravity, in a third a semitangential
        moment (which the fast path leaves to the reference path). On a strut: a thrust about the buckling load,
        half of them exactly along it."""
        if description.name == "strut":
            along = -np.array(description.home.r)[:, 2] * self.thrust * self.rng.uniform(0.3, 2.5)
            aside = np.array(description.home.r)[:, 0] * self.rng.choice([0.0, 1e-3, 1e-1])
            return Loads(along + aside * np.linalg.norm(along), np.zeros(3), np.zeros(3), {})
        force, moment = self.rng.normal(size=3) * 300, self.rng.normal(size=3) * 15
        moment = moment if self.rng.random() < 1 / 3 else np.zeros(3)
        heavy = description.name in ("heavy starts", "spinning rods")
        gravity = GRAVITY if self.rng.random() < (0.9 if heavy else 0.5) else np.zeros(3)
        names = point_names(description)
        on_rods = [n for n in names if n.endswith(PULLED)]
        named = [n for n in names if n not in on_rods and self.rng.random() < 0.7]
        far = [10.0, 100.0] if description.name == "random" else [5.0, 25.0]
        factor = float(self.rng.choice([1.0, 1.0, *far]))
        at = {n: factor * self.rng.normal(size=3) * 100 for n in named}
        at |= {n: self.aside.normal(size=3) * 10 ** self.aside.uniform(0, 2) for n in on_rods}
        return Loads(factor * force, factor * moment, gravity, at)

    def pose(self, description: MachineDescription) -> Pose:
        """In half of the cases home, else a pose near it that the family can take."""
        home, name = description.home, description.name
        shift, turn = np.zeros(3), np.zeros(3)
        if self.rng.random() < 0.5:
            if name in ("hexapod", "spinning rods", "arm"):
                shift, turn = self.rng.uniform(-0.04, 0.04, 3), self.rng.uniform(-0.15, 0.15, 3)
            elif name == "unlike delta":
                shift = self.rng.uniform(-0.06, 0.06, 3)
            elif name == "four legs":
                shift = np.array(home.r) @ [*self.rng.uniform(-0.05, 0.05, 2), 0.0]
                turn = np.array(home.r) @ [0.0, 0.0, self.rng.uniform(-0.2, 0.2)]
        return Pose.of(np.array(home.p) + shift, Rotation.from_rotvec(turn).as_matrix() @ np.array(home.r))

    def declared(self, description: MachineDescription) -> MachineDescription:
        """As a file would have it: in half of the cases, joints declared a micrometre and a microradian off the home
        that closes (only where the joints can make it good)."""
        if description.name not in ("hexapod", "spinning rods", "arm") or self.rng.random() < 0.5:
            return description

        def off(e: Element) -> Element:
            if not isinstance(e, Joint):
                return e
            return replace(
                e,
                home=tuple(
                    float(q + d)
                    for q, d in zip(e.home, self.rng.normal(scale=1e-6, size=len(e.home)), strict=True)
                ),
            )

        legs = tuple(replace(leg, elements=tuple(off(e) for e in leg.elements)) for leg in description.legs)
        return replace(description, legs=legs)

    def _platform(self) -> tuple[Element, ...]:
        return (Body("platform", float(self.rng.uniform(1, 8)), self._vector(0.1)),)

    def _hexapod_places(self) -> tuple[Pose, list[tuple[np.ndarray, np.ndarray]]]:
        """Home, and the foot and head of each leg."""
        tilt = Rotation.from_rotvec(self.rng.uniform(-0.3, 0.3, 3)).as_matrix()
        home = Pose.of((*self.rng.uniform(-0.1, 0.1, 2), self.rng.uniform(0.5, 0.8)), tilt)
        places = []
        for i in range(6):
            pair = 2 * np.pi * (i // 2) / 3
            low = pair + (0.25 if i % 2 else -0.25) + self.rng.normal(scale=0.1)
            high = pair + (0.8 if i % 2 else -0.8) + self.rng.normal(scale=0.1)
            foot = self.rng.uniform(0.4, 0.6) * np.array([np.cos(low), np.sin(low), 0.0])
            head = self.rng.uniform(0.2, 0.3) * np.array([np.cos(high), np.sin(high), 0.0])
            places.append((foot, np.array(home.p) + np.array(home.r) @ head))
        return home, places

    def _strut(self, home: Pose, foot: np.ndarray, head: np.ndarray, below: str) -> tuple[Element, ...]:
        x = (head - foot) / np.linalg.norm(head - foot)
        y = np.cross(self.rng.normal(size=3), x)
        y /= np.linalg.norm(y)
        frame = np.column_stack([x, y, np.cross(x, y)])
        crook = Rotation.from_rotvec(self.rng.uniform(-0.2, 0.2, 3)).as_matrix()
        out: list[Element] = [Offset("foot", Pose.of(foot, frame @ crook))]
        if below == "universal":
            out += [self._passive("cardan", "universal", (Y, Z)), self._offset("crook")]
        else:
            out += [self._joint("low", "spherical"), self._offset("crook")]
        along = np.array(end_of(out).r).T @ x
        law = Law(float(self.rng.uniform(2e6, 2e7)))
        axis = (float(along[0]), float(along[1]), float(along[2]))
        out += [Joint("drive", "prismatic", (axis,), (0.2,), actuated=True, law=law), self._spring("rod")]
        if below == "spherical" or self.rng.random() < 0.5:
            out.append(Body("rod", float(self.rng.uniform(0.5, 4)), self._vector(0.1)))
        if below == "spherical" and self.aside.random() < 0.3:
            out.append(Point(PULLED, tuple(float(v) for v in self.aside.uniform(-0.1, 0.1, 3))))
        turn = np.array(end_of(out).r).T @ Rotation.random(random_state=self.rng).as_matrix()
        out.append(Offset("reach", end_of(out).inverse() @ Pose.of(head, np.array(end_of(out).r) @ turn)))
        out.append(self._joint("ball", "spherical"))
        return (*out, Offset("attach", end_of(out).inverse() @ home))

    def _leg(self, target: Pose) -> tuple[Element, ...]:
        parts = ["drive", "spring", *self._joints(int(self.rng.integers(1, 4)))]
        parts += ["spring"] if self.rng.random() < 0.5 else []
        parts += ["block"] if self.rng.random() < 0.5 else []
        parts += ["body"] if self.rng.random() < 0.5 else []
        parts += ["point"] if self.rng.random() < 0.4 else []
        return self._sequence([str(part) for part in self.rng.permutation(parts)], target)

    def _sequence(self, parts: Sequence[str], target: Pose) -> tuple[Element, ...]:
        out: list[Element] = [self._offset("start")]
        for i, part in enumerate(parts):
            out += [self._element(part, f"{part}{i}"), self._offset(f"link{i}")]
        return (*out, Offset("attach", end_of(out).inverse() @ target))
