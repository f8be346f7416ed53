"""Does the declared home configuration close? Plain geometry with all springs at zero."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stiffmap.description import Block, Element, Joint, MachineDescription, Offset, Pose
from stiffmap.rotations import rotation_about


@dataclass(frozen=True)
class Gap:
    """How far a leg's end is from the home pose, or a branch's end from the first branch (m, rad)."""

    name: str
    translation: float
    rotation: float


def home_gaps(description: MachineDescription) -> list[Gap]:
    """Gap of every leg and of every branch of a block, in the home configuration."""
    gaps: list[Gap] = []
    start = _end(description.base, "base", gaps)
    finish = _end(description.platform, "platform", gaps)
    for leg in description.legs:
        tcp = start @ _end(leg.elements, leg.name, gaps) @ finish
        gaps.append(_gap(leg.name, description.home, tcp))
    return gaps


def _end(elements: tuple[Element, ...], name: str, gaps: list[Gap]) -> Pose:
    """Last frame of a sequence in its first one."""
    pose = Pose()
    for element in elements:
        if isinstance(element, Offset):
            pose = pose @ element.nominal
        elif isinstance(element, Joint):
            pose = pose @ _moved(element)
        elif isinstance(element, Block):
            ends = [_end(b.elements, f"{name}.{b.name}", gaps) for b in element.branches]
            gaps += [
                _gap(f"{name}.{b.name}", ends[0], e)
                for b, e in zip(element.branches[1:], ends[1:], strict=True)
            ]
            pose = pose @ ends[0]
    return pose


def _moved(joint: Joint) -> Pose:
    pose = Pose()
    for axis, value in zip(joint.axes, joint.home, strict=True):
        direction = np.array(axis)
        if joint.kind == "prismatic":
            pose = pose @ Pose.of(value * direction)
        else:
            pose = pose @ Pose.of(rotation=rotation_about(direction, value))
    return pose


def _gap(name: str, a: Pose, b: Pose) -> Gap:
    apart = a.inverse() @ b
    # |R - 1| = 2 sqrt(2) sin(angle / 2) in the Frobenius norm: exact also for small angles
    half = np.linalg.norm(apart.r - np.eye(3)) / (2.0 * np.sqrt(2.0))
    return Gap(name, float(np.linalg.norm(apart.p)), float(2.0 * np.arcsin(min(half, 1.0))))
