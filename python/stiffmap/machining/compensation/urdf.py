"""A serial arm as URDF: nominal geometry of a description, for a controller or a planner."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats
from stiffmap.machining.compensation.geometry import serial_joints
from stiffmap.model.description import MachineDescription


def urdf_text(description: MachineDescription) -> str:
    """URDF of the joints and the tool, m and rad. Raises StiffmapError for a machine that is no serial arm."""
    joints, tool = serial_joints(description)
    robot = ET.Element("robot", name=description.name)
    links = [f"link_{i}" for i in range(len(joints) + 1)]
    for name in (*links, "tool"):
        ET.SubElement(robot, "link", name=name)
    before = (np.zeros(3), np.eye(3))
    for (e, frame, _), parent, child in zip(joints, links[:-1], links[1:], strict=True):
        kind = "prismatic" if e.kind == "prismatic" else "revolute"
        joint = ET.SubElement(robot, "joint", name=e.name, type=kind)
        _place(joint, before, frame, parent, child)
        ET.SubElement(joint, "axis", xyz=_numbers(np.array(e.axes[0])))
        low, high = (e.drive.range if e.drive and e.drive.range else e.limits) or (-1e3, 1e3)
        effort = e.drive.force if e.drive and e.drive.force else 0.0
        speed = e.drive.speed if e.drive and e.drive.speed else 0.0
        ET.SubElement(
            joint, "limit", lower=repr(float(low)), upper=repr(float(high)), effort=repr(float(effort)),
            velocity=repr(float(speed)),
        )  # fmt: skip
        before = frame
    _place(ET.SubElement(robot, "joint", name="tool_joint", type="fixed"), before, tool, links[-1], "tool")
    ET.indent(robot)
    return ET.tostring(robot, encoding="unicode", xml_declaration=True) + "\n"


def _place(
    joint: ET.Element, a: tuple[Floats, Floats], b: tuple[Floats, Floats], parent: str, child: str
) -> None:
    p, r = a[1].T @ (b[0] - a[0]), a[1].T @ b[1]
    rpy = Rotation.from_matrix(r).as_euler("xyz")
    ET.SubElement(joint, "origin", xyz=_numbers(p), rpy=_numbers(rpy))
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)


def _numbers(values: Floats) -> str:
    return " ".join(repr(float(v)) for v in values)
