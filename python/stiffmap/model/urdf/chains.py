"""Ways through a URDF as sequences of elements."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.common.rotations import rotation_about
from stiffmap.model.description import Body, Drive, Element, Joint, Law, Offset, Pose, Spring
from stiffmap.model.urdf.model import UrdfJoint, UrdfModel
from stiffmap.model.urdf.sidecar import Elasticity, LinkSpring, Sidecar

XYZ = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
ZYX = XYZ[::-1]


def plain_name(name: str) -> str:
    """A name that a machine file may hold."""
    return re.sub(r"[^A-Za-z0-9_\-]+", "_", name)


@dataclass
class Chains:
    """Makes elements of joints; knows which joints are motors and what yields."""

    model: UrdfModel
    side: Sidecar
    motors: set[str]
    used: set[str] = field(default_factory=set)

    def sequence(self, way: list[UrdfJoint], end: str | None = None) -> tuple[Element, ...]:
        """Elements along joints; the spring of a link stands at its end, before the joint that leaves
        it, that of `end` at the last frame."""
        out: list[Element] = []
        for joint in way:
            self.used.add(joint.child)
            if joint.origin != Pose():
                out.append(Offset(plain_name(f"{joint.name}_origin"), joint.origin))
            out += self._spring(joint.parent, end)
            if joint.kind != "fixed":
                out.append(self._joint(joint))
                out += self._bodies(joint.child)
        return (*out, *(self._spring(end, None) if end else ()))

    def _spring(self, link: str, end: str | None) -> tuple[Element, ...]:
        given = self.side.springs.get(link)
        return () if given is None or link == end else (link_spring(plain_name(link), given),)

    def _joint(self, joint: UrdfJoint) -> Joint:
        home = self.side.home.get(joint.name, 0.0)
        name = plain_name(joint.name)
        if joint.name in self.side.joint_name:
            return Joint(name, "spherical", XYZ, (0.0, 0.0, 0.0))
        if joint.name not in self.motors:
            return Joint(name, joint.kind, (joint.axis,), (home,), limits=joint.limits)
        return Joint(
            name, joint.kind, (joint.axis,), (home,), actuated=True,
            law=drive_law(self.side.actuators.get(joint.name)),
            drive=Drive(range=joint.limits, speed=joint.velocity, force=joint.effort),
        )  # fmt: skip

    def _bodies(self, head: str) -> list[Body]:
        """Bodies of all links that move with `head`, seen from its frame."""
        out = []
        for link, body in self.model.links.items():
            if body is None or self.model.body_of(link) != head:
                continue
            self.used.add(link)
            at = self.between(head, link)
            turned = at.r @ np.array(body.inertia) @ at.r.T
            com = at.p + at.r @ np.array(body.com)
            out.append(
                Body(plain_name(link), body.mass, Pose.of(com).translation, Pose.of(rotation=turned).rotation)
            )
        return out

    def between(self, head: str, link: str) -> Pose:
        """A link's frame seen from that of a link below which it hangs by fixed joints."""
        out = Pose()
        while link != head:
            out = self.model.above[link].origin @ out
            link = self.model.above[link].parent
        return out


def link_spring(name: str, given: LinkSpring) -> Spring:
    """Six diagonal terms or six rows."""
    values = given.stiffness if given.stiffness is not None else given.compliance
    array = np.array(values, dtype=float)
    rows = tuple(tuple(float(v) for v in row) for row in (np.diag(array) if array.ndim == 1 else array))
    return Spring(name, stiffness=rows) if given.stiffness is not None else Spring(name, compliance=rows)


def drive_law(given: Elasticity | None) -> Law | None:
    """Law of a drive; None: rigid."""
    if given is None:
        return None
    return Law(given.stiffness if given.stiffness is not None else 1 / (given.compliance or np.inf))


def ball(name: str, turned: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> Joint:
    """Ball joint whose home coordinates make the rotation `turned`."""
    home = tuple(float(v) for v in Rotation.from_matrix(turned).as_euler("ZYX"))
    return Joint(name, "spherical", ZYX, home)


def end_pose(elements: tuple[Element, ...]) -> Pose:
    """Last frame of a sequence without blocks at home, seen from its first."""
    out = Pose()
    for e in elements:
        if isinstance(e, Offset):
            out = out @ e.nominal
        elif isinstance(e, Joint):
            for axis, q in zip(e.axes, e.home, strict=True):
                step = Pose.of(q * np.array(axis)) if e.kind == "prismatic" else Pose.of(
                    rotation=rotation_about(np.array(axis), q))  # fmt: skip
                out = out @ step
    return out
