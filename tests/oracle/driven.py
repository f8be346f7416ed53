"""Random machines with more drives than freedoms, arms of four to nine axes, wrists behind platforms, next to nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.model.description import (
    Block,
    Body,
    Branch,
    CommandError,
    Element,
    Joint,
    Law,
    Leg,
    MachineDescription,
    Offset,
    Pose,
)

from .generate import X, Y, Z
from .parts import end_of
from .tasks import NONE, Asking, Task


class Driven(Asking):
    """One task each."""

    def _plane_leg(
        self, foot: np.ndarray, home: Pose, joint: np.ndarray, last: bool, rigid: bool
    ) -> tuple[Element, ...]:
        """A leg R-R(-R) in the plane from a foot over an elbow to a joint of the platform."""
        reach = joint - foot
        span = np.linalg.norm(reach[:2])
        one, two = span * self.rng.uniform(0.55, 0.75, 2)
        side = self.rng.choice([-1.0, 1.0]) * np.arccos((one**2 + span**2 - two**2) / (2 * one * span))
        first = float(np.arctan2(reach[1], reach[0]) + side)
        elbow = foot + one * np.array([np.cos(first), np.sin(first), 0.0])
        second = float(np.arctan2(*(joint - elbow)[1::-1])) - first
        law = Law(float(10 ** self.rng.uniform(3.5, 5)), 1e8 if self.rng.random() < 0.2 else 0.0)
        errors = (CommandError(offset=float(self.rng.normal(scale=2e-4))),) if self.rng.random() < 0.3 else ()
        out: list[Element] = [Offset("foot", Pose.of(foot))]
        out.append(Joint("motor", "revolute", (Z,), (first,), actuated=True, law=law, command_errors=errors))
        out.append(Offset("upper", Pose.of((one, 0, 0))))
        if not rigid:
            out.append(self._spring("upper_spring", 30.0))
        out.append(Body("upper_arm", float(self.rng.uniform(0.5, 3)), self._vector(0.1)))
        out.append(Joint("elbow", "revolute", (Z,), (second,)))
        out += [Offset("lower", Pose.of((two, 0, 0))), self._spring("lower_spring", 10.0)]
        if not last:
            out.append(self._passive("wrist", "revolute", (Z,)))
        return (*out, Offset("attach", end_of(out).inverse() @ home))

    def over_actuated(self) -> Task:
        """Three or four legs RR on one point, or four or five RRR on a platform: more drives than freedoms."""
        turning = bool(self.rng.random() < 0.5)
        count = int(self.rng.integers(4, 6)) if turning else int(self.rng.integers(3, 5))
        home = Pose.of((*self.rng.uniform(-0.05, 0.05, 2), 0.0))
        legs = []
        for i in range(count):
            angle = 2 * np.pi * i / count + self.rng.normal(scale=0.15)
            foot = self.rng.uniform(0.4, 0.6) * np.array([np.cos(angle), np.sin(angle), 0.0])
            joint = np.array(home.p) + turning * 0.1 * np.array([np.cos(angle), np.sin(angle), 0.0])
            last = not turning and i == 0
            rigid = bool(self.rng.random() < 0.4)
            legs.append(Leg(f"leg{i}", self._plane_leg(foot, home, joint, last, rigid)))
        task = ("x", "y", "rz") if turning else ("x", "y")
        d = MachineDescription("over-actuated", tuple(legs), platform=self._platform(), home=home, task=task)
        shift = np.array([*self.rng.uniform(-0.05, 0.05, 2), 0.0])
        turn = Rotation.from_rotvec([0, 0, self.rng.uniform(-0.2, 0.2) * turning]).as_matrix()
        pose = Pose.of(np.array(home.p) + shift, turn @ np.array(home.r))
        return self._asked(d, pose, 200.0, by_pose=True)

    def gantry(self) -> Task:
        """Two drives on the columns of one beam, a carriage across it, a ram."""
        width = float(self.rng.uniform(0.4, 1.0))
        branches = []
        for i, side in enumerate((-1.0, 1.0)):
            law = Law(float(self.rng.uniform(5e6, 5e7)), 1e14 if self.rng.random() < 0.2 else 0.0)
            slip = (
                (CommandError(offset=float(self.rng.normal(scale=2e-5))),) if self.rng.random() < 0.5 else ()
            )
            inner: list[Element] = [Offset("column", Pose.of((side * width, 0, 1.0)))]
            inner.append(Joint("y", "prismatic", (Y,), (0.1,), actuated=True, law=law, command_errors=slip))
            inner.append(self._spring("shoe", 0.1))
            if self.rng.random() < 0.5:
                inner.append(self._passive("pivot", "revolute", (Z,), (0.0,)))
            if i and self.rng.random() < 0.5:
                inner.append(self._passive("float", "prismatic", (X,), (0.0,)))
            inner.append(Offset("to_beam", Pose.of((-side * width, 0, 0))))
            branches.append(Branch(f"side{i}", tuple(inner)))
        out: list[Element] = [Block("beam", tuple(branches)), Body("beam_body", 50.0, self._vector(0.2))]
        for name, axis in (("x", X), ("z", Z)):
            law = Law(float(self.rng.uniform(5e6, 5e7)))
            out.append(Offset(f"to_{name}", Pose.of(self._vector(0.3), self._turn(0.1))))
            out.append(
                Joint(
                    name, "prismatic", (axis,), (float(self.rng.uniform(-0.2, 0.2)),), actuated=True, law=law
                )
            )
            out += [self._spring(f"shoe_{name}", 0.1)]
            out.append(Body(f"slide_{name}", float(self.rng.uniform(5, 20)), self._vector(0.1)))
        out.append(Offset("spindle", Pose.of(self._vector(0.2))))
        d = MachineDescription(
            "gantry", (Leg("gantry", tuple(out)),), platform=self._platform(), home=end_of(out)
        )
        shift = self.rng.uniform(-0.2, 0.2, 3)
        return self._asked(d, Pose.of(np.array(d.home.p) + shift, d.home.r), 1000.0, by_pose=True)

    def arm(self) -> Task:
        """Four to nine axes, links elastic or not, drives elastic or rigid."""
        count = int(self.rng.integers(4, 10))
        soft = float(self.rng.choice([0.0, 0.5, 1.0]))
        out: list[Element] = [self._offset("floor")]
        for i in range(count):
            slides = self.rng.random() < 0.15
            kind = "prismatic" if slides else "revolute"
            law = Law(float(10 ** self.rng.uniform(5.5, 7) if slides else 10 ** self.rng.uniform(4, 6)))
            if self.rng.random() < 0.2:
                law = replace(law, cubic=float(law.stiffness * 1e4))
            rigid = self.rng.random() < 0.1
            home = (float(self.rng.uniform(-1, 1)),)
            out.append(
                Joint(f"axis{i}", kind, (self._axis(),), home, actuated=True, law=None if rigid else law)
            )
            out.append(Offset(f"link{i}", Pose.of(self._vector(0.3), self._turn(0.5))))
            out += [self._spring(f"elastic{i}", 3.0)] if self.rng.random() < soft else []
            out.append(Body(f"body{i}", float(self.rng.uniform(1, 10)), self._vector(0.15), self._inertia()))
        d = MachineDescription(
            "arm of axes", (Leg("arm", tuple(out)),), platform=self._platform(), home=end_of(out)
        )
        drives = {
            f"arm.axis{i}": self._value(out, f"axis{i}") + float(self.rng.uniform(-0.3, 0.3))
            for i in range(count)
        }
        return self._asked(d, drives, 200.0, by_pose=count == 6)

    def hybrid(self) -> Task:
        """Three legs UPS and a middle leg UP that bears what they do not; two or three axes behind the platform."""
        home = Pose.of((*self.rng.uniform(-0.05, 0.05, 2), 0.8))
        legs = []
        for i in range(3):
            angle = 2 * np.pi * i / 3 + self.rng.normal(scale=0.1)
            way = np.array([np.cos(angle), np.sin(angle), 0.0])
            head = np.array(home.p) + 0.15 * way
            legs.append(Leg(f"leg{i}", self._strut(home, 0.5 * way, head, "universal")))
        z = np.array(home.p) / np.linalg.norm(home.p)
        x = np.cross(Y, z) / np.linalg.norm(np.cross(Y, z))
        out: list[Element] = [Offset("eye", Pose.of(NONE, np.column_stack([x, np.cross(z, x), z])))]
        out.append(Joint("cardan", "universal", (X, Y), (0.0, 0.0)))
        out += [self._spring("root", 100.0)] if self.rng.random() < 0.7 else []
        out.append(Joint("tube", "prismatic", (Z,), (float(np.linalg.norm(home.p)),)))
        out += [Body("tube_body", 10.0, self._vector(0.1)), self._spring("tube_spring", 100.0)]
        out.append(Offset("attach", end_of(out).inverse() @ home))
        legs.append(Leg("middle", tuple(out)))
        wrist: list[Element] = [Body("head", float(self.rng.uniform(2, 10)), self._vector(0.1))]
        count = int(self.rng.integers(2, 4))
        for i in range(count):
            law = Law(float(10 ** self.rng.uniform(4, 6)))
            axis = (Z, Y, X)[i] if self.rng.random() < 0.5 else self._axis()
            wrist.append(
                Joint(
                    f"wrist{i}",
                    "revolute",
                    (axis,),
                    (float(self.rng.uniform(-1, 1)),),
                    actuated=True,
                    law=law,
                )
            )
            wrist.append(Offset(f"hand{i}", Pose.of(self._vector(0.1), self._turn(0.3))))
            wrist.append(
                Body(f"hand{i}", float(self.rng.uniform(0.5, 3)), self._vector(0.05), self._inertia())
            )
            wrist += [self._spring(f"hand{i}_spring", 30.0)] if self.rng.random() < 0.4 else []
        d = MachineDescription("hybrid", tuple(legs), platform=tuple(wrist), home=home @ end_of(wrist))
        drives = {f"leg{i}.drive": 0.2 + float(self.rng.uniform(-0.04, 0.04)) for i in range(3)}
        drives |= {
            f"wrist{i}": self._value(wrist, f"wrist{i}") + float(self.rng.uniform(-0.3, 0.3))
            for i in range(count)
        }
        return self._asked(d, drives, 400.0, by_pose=count == 3)

    def few(self) -> Task:
        """None, one or two elements that can move."""
        out: list[Element] = [self._offset("start")]
        for i in range(int(self.rng.integers(1, 3))):
            kind = str(self.rng.choice(["spring", "drive", "rigid drive", "hinge", "body"]))
            if kind == "spring":
                out.append(self._spring(f"spring{i}"))
            elif kind == "body":
                out.append(Body(f"mass{i}", 2.0, self._vector(0.1)))
            elif kind == "hinge":
                out.append(
                    Joint(
                        f"hinge{i}",
                        "revolute",
                        (self._axis(),),
                        (0.3,),
                        law=Law(float(10 ** self.rng.uniform(3, 5))),
                    )
                )
            else:
                law = None if kind.startswith("rigid") else Law(float(self.rng.uniform(1e6, 1e7)))
                out.append(Joint(f"drive{i}", "prismatic", (self._axis(),), (0.2,), actuated=True, law=law))
            out.append(self._offset(f"link{i}"))
        d = MachineDescription(
            "few",
            (Leg("only", tuple(out)),),
            home=end_of([replace(e, actual=None) if isinstance(e, Offset) else e for e in out]),
        )
        return self._asked(d, None, 100.0, by_pose=True)
