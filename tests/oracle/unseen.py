"""Machines of classes that no shipped machine belongs to, built by hand: for oracles and benchmarks.

Every function returns a `MachineDescription` that closes at home, with a workspace box in which it closes; `UNSEEN` lists them.
All dimensions, stiffnesses and masses are invented.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stiffmap.model.description import (
    Block,
    Body,
    Branch,
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

from .parts import end_of
from .pieces import X, Y, Z, beam, box_of, closed, leaf, matrix, pulls, strut, triple, turn


def over_actuated_3rr() -> MachineDescription:
    """A point in the plane on three legs of two links, each with a drive at its base: one drive more than freedoms."""
    at = np.array([0.02, 0.03])
    legs = []
    for i, angle in enumerate((90.0, 210.0, 330.0)):
        foot = 0.5 * np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
        upper, fore = 0.3, 0.36
        to, line = at - foot, np.linalg.norm(at - foot)
        towards = np.arctan2(to[1], to[0])
        shoulder = towards + np.arccos((upper**2 + line**2 - fore**2) / (2 * upper * line))
        elbow = -np.pi + np.arccos((upper**2 + fore**2 - line**2) / (2 * upper * fore))
        out: list[Element] = [
            Offset("foot", Pose.of((*foot, 0.0))),
            Joint("motor", "revolute", (Z,), (float(shoulder),), actuated=True, law=Law(4e4)),
            Offset("arm_length", Pose.of((upper, 0, 0))),
            Body("arm", 1.2, (-0.15, 0.0, 0.0)),
            beam("arm", upper, 0.04),
            Joint("elbow", "revolute", (Z,), (float(elbow),)),
            Offset("forearm_length", Pose.of((fore, 0, 0))),
            Body("forearm", 1.0, (-0.18, 0.0, 0.0)),
            beam("forearm", fore, 0.03),
        ]
        if i > 0:  # the first leg carries the tool
            out.append(Joint("pin", "revolute", (Z,), (float(-shoulder - elbow),)))
        legs.append(closed(f"leg{i}", out, Pose.of((*at, 0.0))))
    box = ((-0.1, -0.1, 0.0), (0.1, 0.1, 0.0))
    tool = (Body("tool", 0.8),)
    return MachineDescription(
        "over-actuated 3-RR",
        tuple(legs),
        platform=tool,
        home=Pose.of((*at, 0.0)),
        workspace=box,
        task=("x", "y"),
    )


def seven_axis_arm() -> MachineDescription:
    """Seven elastic revolute drives, shoulder and wrist with three axes that meet, no spring in the links."""
    axes = (Z, Y, Z, Y, Z, Y, Z)
    homes = (0.2, 0.5, -0.3, -1.3, 0.4, 0.9, 0.1)
    stiff = (2e5, 2e5, 1.5e5, 1.2e5, 8e4, 5e4, 4e4)
    heights = (0.34, 0.0, 0.40, 0.0, 0.40, 0.0, 0.126)
    masses = (4.0, 4.5, 3.0, 2.7, 1.7, 1.8, 0.3)
    out: list[Element] = []
    for i, (axis, home, k, height, mass) in enumerate(zip(axes, homes, stiff, heights, masses, strict=True)):
        out.append(Joint(f"axis{i + 1}", "revolute", (axis,), (home,), actuated=True, law=Law(k)))
        out.append(Body(f"link{i + 1}", mass, (0.0, 0.02, height / 2)))
        if height:
            out.append(Offset(f"length{i + 1}", Pose.of((0, 0, height))))
    home_pose = end_of(out)
    low, high = home_pose.p - 0.1, home_pose.p + 0.1
    return MachineDescription(
        "seven-axis arm",
        (Leg("arm", tuple(out)),),
        platform=(Body("tool", 2.0, (0.0, 0.0, 0.05)),),
        home=home_pose,
        workspace=box_of(low, high),
    )


def tricept_with_wrist() -> MachineDescription:
    """Three struts with drives and a central leg without, both elastic; behind their platform a wrist of two turning drives
    with an elastic fork between. Five axes: rotation about the tool's axis follows."""
    at = np.array([0.05, -0.04, -1.0])
    lay = (float(np.arctan2(at[1], -at[2])), float(np.arctan2(-at[0], np.hypot(at[1], at[2]))))
    central: list[Element] = [
        Joint("cardan", "universal", (X, Y), lay),
        Joint("slide", "prismatic", (Z,), (-float(np.linalg.norm(at)),)),
        Body("tube", 20.0, (0.0, 0.0, 0.3)),
        beam("tube", 1.0, 0.12, along="z"),
    ]
    end = end_of(central)
    legs = [Leg("central", tuple(central))]
    for i in range(3):
        angle = 2 * np.pi * i / 3 + 0.3
        foot = 0.5 * np.array([np.cos(angle), np.sin(angle), 0.1])
        head = end.p + end.r @ (0.18 * np.array([np.cos(angle), np.sin(angle), 0.0]))
        legs.append(strut(f"strut{i}", foot, head, end, Law(8e7), elastic=True))
    wrist: tuple[Element, ...] = (
        Body("platform", 15.0, (0.0, 0.0, -0.05)),
        Offset("down", Pose.of((0, 0, -0.15))),
        Joint("fork", "revolute", (Z,), (0.3,), actuated=True, law=Law(3e5)),
        Offset("side", Pose.of((0, 0, -0.12))),
        beam("fork", 0.2, 0.1, along="z"),
        Body("fork", 8.0, (0.0, 0.05, 0.0)),
        Joint("swivel", "revolute", (Y,), (0.5,), actuated=True, law=Law(2e5)),
        Body("spindle", 12.0, (0.0, 0.0, -0.1)),
        Offset("tool", Pose.of((0, 0, -0.2))),
    )
    home = end @ end_of(list(wrist))
    box = box_of(home.p - [0.2, 0.2, 0.15], home.p + [0.2, 0.2, 0.15])
    return MachineDescription(
        "tricept with wrist",
        tuple(legs),
        platform=wrist,
        home=home,
        workspace=box,
        task=("x", "y", "z", "rx", "ry"),
    )


def leaf_spring_stage(count: int = 2, segments: int = 6) -> MachineDescription:
    """A stage on upright leaf springs, each a row of short springs and offsets: no joint, no drive; soft enough to bend far."""
    long, wide, thick = 0.12, 0.02, 4e-4
    places = np.linspace(-0.03, 0.03, count) if count > 1 else np.zeros(1)
    home = Pose.of((0, 0, long))
    legs = []
    for i, x in enumerate(places):
        out: list[Element] = [Offset("root", Pose.of((x, 0, 0)))]
        for k in range(segments):
            step = Offset(f"half{k}", Pose.of((0, 0, long / segments / 2)))
            out += [
                step,
                leaf(f"leaf{k}", long / segments, wide, thick),
                Offset(f"other{k}", step.nominal),
            ]
        legs.append(closed(f"leaf{i}", out, home))
    stage = (Body("stage", 0.05, (0.0, 0.0, 0.005)),)
    box = (home.translation, home.translation)
    return MachineDescription("leaf-spring stage", tuple(legs), platform=stage, home=home, workspace=box)


def leaf_spring() -> MachineDescription:
    """One clamped leaf spring: a tip force of its bending stiffness over its length squared bends it by a radian or two."""
    d = leaf_spring_stage(1, 8)
    return MachineDescription("leaf spring", d.legs, platform=d.platform, home=d.home, workspace=d.workspace)


def twin_drive_gantry() -> MachineDescription:
    """A beam on two parallel guides, each with its own drive, elastic carriages; across it a slide, down it another."""
    sides: list[Branch] = []
    for i, x in enumerate((-0.6, 0.6)):
        out: list[Element] = [
            Offset("rail", Pose.of((x, 0, 0.6))),
            Joint("y", "prismatic", (Y,), (0.2,), actuated=True, law=Law(3e7 + 5e6 * i)),
            Body("carriage", 15.0, (0.0, 0.0, 0.05)),
            matrix("wagon", [4e8, 3e8, 5e8, 4e6, 5e6, 3e6]),
            Offset("half", Pose.of((-x, 0, 0))),
            beam("beam_half", 0.6, 0.15),
        ]
        sides.append(Branch(f"side{i}", tuple(out)))
    gantry: list[Element] = [
        Block("portal", tuple(sides)),
        Body("beam", 60.0),
        Joint("x", "prismatic", (X,), (0.1,), actuated=True, law=Law(2.5e7)),
        Body("slide", 20.0),
        matrix("slide_wagon", [4e8, 3e8, 5e8, 4e6, 5e6, 3e6]),
        Joint("z", "prismatic", (Z,), (-0.1,), actuated=True, law=Law(2e7)),
        Offset("ram", Pose.of((0, 0, -0.2))),
        beam("ram", 0.3, 0.12, along="z"),
        Body("spindle", 12.0, (0.0, 0.0, 0.1)),
    ]
    home = end_of(gantry)
    box = ((-0.3, -0.3, 0.15), (0.3, 0.3, 0.45))
    return MachineDescription(
        "twin-drive gantry",
        (Leg("gantry", tuple(gantry)),),
        home=home,
        workspace=box,
        task=("x", "y", "z"),
    )


def planar_cable_suspension() -> MachineDescription:
    """A plate in the plane on four cables, each a hinge, a drive that only pulls and a hinge; a slide on a slide on a hinge, all
    free, keeps it in the plane."""
    home = Pose.of((0.05, 0.0, -0.02), turn("z", 4.0))
    corners = ((-0.8, -0.5), (0.8, -0.5), (0.8, 0.6), (-0.8, 0.6))
    legs: list[Leg] = []
    guide: list[Element] = [
        matrix("floor", [1e8, 1e8, 1e8, 1e6, 1e6, 1e6]),
        Joint("gx", "prismatic", (X,), (0.05,)),
        Joint("gy", "prismatic", (Y,), (0.0,)),
        Joint("gz", "revolute", (Z,), (float(np.radians(4.0)),)),
    ]
    legs.append(closed("plane", guide, home))
    for i, corner in enumerate(corners):
        foot = np.array([*corner, 0.0])
        local = np.array([0.1 if corner[0] > 0 else -0.1, 0.06 if corner[1] > 0 else -0.06, 0.0])
        head = home.p + home.r @ local - [0, 0, home.p[2]]
        line = head - foot
        out: list[Element] = [
            Offset("eye", Pose.of(foot)),
            Joint("hinge", "revolute", (Z,), (float(np.arctan2(line[1], line[0])),)),
            Joint(
                "winch",
                "prismatic",
                (X,),
                (float(np.linalg.norm(line)),),
                actuated=True,
                law=pulls(2e5, 1e-3),
            ),
            matrix("root", [1e9, 1e8, 1e8, 1e6, 1e6, 1e6]),
            Joint("pin", "revolute", (Z,), (0.0,)),
        ]
        legs.append(closed(f"cable{i}", out, home))
    box = ((-0.2, -0.15, home.p[2]), (0.2, 0.15, home.p[2]))
    plate = (Body("plate", 5.0, (0.0, 0.01, 0.0)),)
    return MachineDescription(
        "planar cable suspension",
        tuple(legs),
        platform=plate,
        home=home,
        workspace=box,
        gravity=(0.0, -9.81, 0.0),
    )


def cable_suspension(preload: float = 9e-4) -> MachineDescription:
    """A platform on eight cables, each a universal joint, a drive that only pulls (wound up by `preload` m) and a ball."""
    home = Pose.of((0.03, -0.04, 0.9), turn("z", 5.0))
    legs = []
    for i in range(8):
        low = i >= 4
        a, b = (-1 if i % 4 in (0, 1) else 1), (-1 if i % 4 in (0, 3) else 1)
        foot = np.array([0.9 * a, 0.7 * b, 1.9]) if not low else np.array([0.7 * a, 0.9 * b, 0.05])
        local = np.array([0.15 * a, 0.1 * b, 0.1]) if not low else np.array([0.1 * a, -0.15 * b, -0.1])
        head = home.p + home.r @ local
        legs.append(strut(f"cable{i}", foot, head, home, pulls(9e5, preload)))
    box = ((-0.2, -0.2, 0.7), (0.2, 0.2, 1.1))
    return MachineDescription(
        "cable suspension",
        tuple(legs),
        platform=(Body("platform", 60.0, (0.005, -0.008, 0.03)), Offset("tool", Pose())),
        home=home,
        workspace=box,
        gravity=(0.0, 0.0, -9.81),
    )


def hung_on_springs() -> MachineDescription:
    """An elastic column with a hinge at its foot that six springs hold at points of its platform, three of them pulling only."""
    home = Pose.of((0, 0, 0.6))
    column: list[Element] = [
        Joint("turn", "revolute", (Z,), (0.0,), actuated=True, law=Law(2e4)),
        Joint("lift", "prismatic", (Z,), (0.6,), actuated=True, law=Law(5e6)),
        matrix("column", [2e5, 3e5, 5e7, 2e4, 3e4, 1e4]),
    ]
    points, springs = [], []
    for i in range(6):
        angle = np.pi / 3 * i + 0.2
        local = 0.2 * np.array([np.cos(angle), np.sin(angle), 0.1 * (-1) ** i])
        anchor = np.array([np.cos(angle + 0.3), np.sin(angle + 0.3), 0.6 + 0.5 * (-1) ** i])
        points.append(Point(f"eye{i}", triple(local)))
        length = 0.98 * float(np.linalg.norm(anchor - home.p - local))
        springs.append(
            ExternalSpring(f"spring{i}", f"platform.eye{i}", triple(anchor), 3e4, length, i % 2 == 0)
        )
    return MachineDescription(
        "hung on springs",
        (Leg("column", tuple(column)),),
        platform=(Body("platform", 10.0), *points),
        home=home,
        workspace=((0.0, 0.0, 0.5), (0.0, 0.0, 0.7)),
        external_springs=tuple(springs),
        task=("z", "rz"),
    )


UNSEEN: dict[str, Callable[[], MachineDescription]] = {
    "over-actuated 3-RR": over_actuated_3rr,
    "seven-axis arm": seven_axis_arm,
    "tricept with wrist": tricept_with_wrist,
    "leaf-spring stage": leaf_spring_stage,
    "leaf spring": leaf_spring,
    "twin-drive gantry": twin_drive_gantry,
    "planar cable suspension": planar_cable_suspension,
    "cable suspension": cable_suspension,
    "hung on springs": hung_on_springs,
}
