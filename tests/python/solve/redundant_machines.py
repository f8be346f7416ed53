"""Machines with more drives than a pose or their freedoms need, written as descriptions, with kinematics of their own."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

import stiffmap as sm
from stiffmap.model.description import Body, Drive, Element, Joint, Law, Leg, MachineDescription, Offset, Pose

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def motor(name: str, axis: str, home: float, stiffness: float, kind: str = "revolute") -> Joint:
    drive = Drive(speed=1.0, force=200.0, encoder_error=1e-5)
    return Joint(name, kind, (AXES[axis],), home=(home,), actuated=True, law=Law(stiffness), drive=drive)


class Arm:
    """A row of driven joints: (name, kind, axis, offset to it in the frame before, home, stiffness), then the tool."""

    def __init__(
        self,
        name: str,
        joints: list[tuple[str, str, str, tuple[float, float, float], float, float]],
        tool: tuple[float, float, float],
        task: tuple[str, ...] = ("x", "y", "z", "rx", "ry", "rz"),
        half: float = 0.12,
    ) -> None:
        self.joints, self.tool = joints, tool
        self.home = np.array([j[4] for j in joints])
        elements: list[Element] = []
        for n, kind, axis, offset, home, stiffness in joints:
            elements += [
                Offset(f"to_{n}", Pose.of(offset)),
                motor(n, axis, home, stiffness, kind),
                Body(
                    f"link_{n}",
                    2.0,
                    com=(0.01, 0.02, 0.03),
                    inertia=((0.02, 0.0, 0.0), (0.0, 0.03, 0.0), (0.0, 0.0, 0.01)),
                ),
            ]
        elements.append(Offset("tool", Pose.of(tool)))
        p, r = self.tip(self.home)
        box = (tuple(p - half), tuple(p + half))
        if task == ("x", "y", "rz"):
            box = ((*(p - half)[:2], p[2]), (*(p + half)[:2], p[2]))
        self.machine = sm.Machine(
            MachineDescription(
                name,
                (Leg("arm", tuple(elements)),),
                home=Pose.of(p, r),
                workspace=box,  # type: ignore[arg-type]
                task=task,
            )
        )

    def tip(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position and rotation at joint coordinates, by SciPy's rotations."""
        p, r = np.zeros(3), np.eye(3)
        for value, (_, kind, axis, offset, _, _) in zip(q, self.joints, strict=True):
            p = p + r @ np.array(offset)
            if kind == "prismatic":
                p = p + r @ (value * np.array(AXES[axis]))
            else:
                r = r @ Rotation.from_rotvec(value * np.array(AXES[axis])).as_matrix()
        return p + r @ np.array(self.tool), r

    def jacobian(self, q: np.ndarray, h: float = 1e-6) -> np.ndarray:
        """(6, joints) by central differences."""
        columns = []
        for e in np.eye(len(q)):
            (p1, r1), (p0, r0) = self.tip(q + h * e), self.tip(q - h * e)
            columns.append(np.concatenate([p1 - p0, Rotation.from_matrix(r1 @ r0.T).as_rotvec()]) / (2 * h))
        return np.array(columns).T

    @property
    def units(self) -> np.ndarray:
        """Lengths that a unit of each joint stands for."""
        length = self.machine.compiled.length
        return np.array([1.0 if j[1] == "prismatic" else length for j in self.joints])


def seven_axes() -> Arm:
    """The dimensions of a light arm with a shoulder, an elbow and a wrist of three, three and one axes that meet."""
    home = (0.3, 0.5, 0.2, -1.3, 0.1, 0.8, 0.2)
    offsets = ((0, 0, 0.2), (0, 0, 0.16), (0, 0, 0.2), (0, 0, 0.22), (0, 0, 0.2), (0, 0, 0.2), (0, 0, 0.06))
    stiff = (8e4, 8e4, 5e4, 5e4, 3e4, 2e4, 2e4)
    joints = [(f"a{i + 1}", "revolute", "zyzyzyz"[i], offsets[i], home[i], stiff[i]) for i in range(7)]
    return Arm("seven", joints, (0.0, 0.0, 0.066))


def planar_four() -> Arm:
    """Four revolutes in a plane, of which x, y and the heading are commanded."""
    home = (0.2, 1.5, -2.0, 1.3)
    joints = [
        (f"a{i + 1}", "revolute", "z", ((0.0 if i == 0 else 0.4 - 0.05 * i), 0.0, 0.0), home[i], 3e4)
        for i in range(4)
    ]
    return Arm("planar_four", joints, (0.2, 0.0, 0.0), task=("x", "y", "rz"))


def arm_on_a_rail() -> Arm:
    """Six axes with the dimensions of a UR10, on a rail along y."""
    s = 1.0
    joints = [
        ("rail", "prismatic", "y", (0.0, 0.0, 0.1), 0.0, 2e7),
        ("a1", "revolute", "z", (0.0, 0.0, 0.1273), 0.4, 6e4),
        ("a2", "revolute", "y", (0.0, 0.22, 0.0), -1.2, 6e4),
        ("a3", "revolute", "y", (0.0, -0.1719, 0.612 * s), 1.4, 4e4),
        ("a4", "revolute", "y", (0.0, 0.0, 0.5723 * s), 0.9, 2e4),
        ("a5", "revolute", "z", (0.0, 0.1149, 0.0), 0.5, 2e4),
        ("a6", "revolute", "y", (0.0, 0.0, 0.1157), -0.3, 2e4),
    ]
    return Arm("rail_arm", joints, (0.0, 0.0922, 0.0))


ARMS = {"seven": seven_axes, "planar_four": planar_four, "rail_arm": arm_on_a_rail}


STIFF = (2e7, 5e7)
"""N/m of the two drives along y."""
BRIDGE = 24.0
"""kg."""


def twin_gantry() -> sm.Machine:
    """Two drives along y carry one bridge; x and z on it. Rigid but for the drives."""

    def column(name: str, x: float, stiffness: float) -> Leg:
        home = Offset("foot", Pose.of((x, 0.0, 0.5)))
        back = Offset("half_bridge", Pose.of((-x, 0.0, 0.0)))
        return Leg(name, (home, motor("drive", "y", 0.0, stiffness, "prismatic"), back))

    inertia = ((0.4, 0.0, 0.0), (0.0, 0.3, 0.0), (0.0, 0.0, 0.5))
    carried: tuple[Element, ...] = (
        Body("bridge", BRIDGE, inertia=inertia),
        motor("x", "x", 0.0, 3e7, "prismatic"),
        motor("z", "z", 0.0, 4e7, "prismatic"),
        Body("head", 6.0, com=(0.0, 0.0, -0.05), inertia=inertia),
        Offset("tool", Pose.of((0.0, 0.0, -0.2))),
    )
    return sm.Machine(
        MachineDescription(
            "twin_gantry",
            (column("y1", -0.6, STIFF[0]), column("y2", 0.6, STIFF[1])),
            platform=carried,
            home=Pose.of((0.0, 0.0, 0.3)),
            workspace=((-0.3, -0.3, 0.2), (0.3, 0.3, 0.4)),
            task=("x", "y", "z"),
        )
    )


CRANK, ROD = 0.25, 0.35
PIVOTS = 0.4 * np.array([[np.cos(a), np.sin(a)] for a in (0.2, 2.3, 4.4)])
MASS = 3.0


def cranks(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angles of the three cranks and elbows at a tool position (2,): elbows all to the same side."""
    first, second = [], []
    for pivot in PIVOTS:
        d = p - pivot
        far = np.linalg.norm(d)
        at_elbow = np.arccos((CRANK**2 + ROD**2 - far**2) / (2 * CRANK * ROD))
        at_pivot = np.arccos((CRANK**2 + far**2 - ROD**2) / (2 * CRANK * far))
        first.append(np.arctan2(d[1], d[0]) - at_pivot)
        second.append(np.pi - at_elbow)
    return np.array(first), np.array(second)


def rates_of_cranks(p: np.ndarray) -> np.ndarray:
    """(3, 2) rates of the cranks per velocity of the tool, from the lengths of the rods."""
    angle, _ = cranks(p)
    rows = []
    for pivot, a in zip(PIVOTS, angle, strict=True):
        rod = p - pivot - CRANK * np.array([np.cos(a), np.sin(a)])
        rows.append(rod / (rod @ (CRANK * np.array([-np.sin(a), np.cos(a)]))))
    return np.array(rows)


def three_cranks(stiffness: tuple[float, float, float] = (4e4, 4e4, 4e4)) -> sm.Machine:
    """Three cranks with rods to one point, all driven: one drive more than the point has freedoms."""
    home = np.array([0.03, -0.02])
    first, second = cranks(home)
    legs = []
    for i, pivot in enumerate(PIVOTS):
        elements: list[Element] = [
            Offset("pivot", Pose.of((*pivot, 0.0))),
            motor("crank", "z", first[i], stiffness[i]),
            Offset("arm", Pose.of((CRANK, 0.0, 0.0))),
            Joint("elbow", "revolute", (AXES["z"],), home=(second[i],)),
            Offset("rod", Pose.of((ROD, 0.0, 0.0))),
        ]
        turned = -(first[i] + second[i])
        if i > 0:
            elements.append(Joint("pin", "revolute", (AXES["z"],), home=(turned,)))
        else:
            elements.append(Offset("end", Pose.of((0, 0, 0), Rotation.from_euler("z", turned).as_matrix())))
        legs.append(Leg(f"leg{i + 1}", tuple(elements)))
    return sm.Machine(
        MachineDescription(
            "three_cranks",
            tuple(legs),
            platform=(Body("tool", MASS),),
            home=Pose.of((*home, 0.0)),
            workspace=((-0.1, -0.1, 0.0), (0.1, 0.1, 0.0)),
            task=("x", "y"),
        )
    )
