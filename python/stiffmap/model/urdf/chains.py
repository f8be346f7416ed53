"""Ways through a URDF as sequences of elements."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.common.errors import FileError
from stiffmap.common.rotations import rotation_about
from stiffmap.model.description import Body, Drive, Element, Joint, Law, Offset, Pose, Spring
from stiffmap.model.description.pose import Vector
from stiffmap.model.description.strokes import as_rows
from stiffmap.model.urdf.model import DUST, UrdfJoint, UrdfModel, tensor
from stiffmap.model.urdf.sidecar import Elasticity, LinkSpring, Sidecar

XYZ = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
ZYX = XYZ[::-1]


def plain_name(name: str) -> str:
    """A name that a machine file may hold."""
    return re.sub(r"[^A-Za-z0-9_\-]+", "_", name)


def free_name(name: str, taken: Iterable[str]) -> str:
    """A name that the import makes up, with lines under its end as long as something of the file has it."""
    taken = set(taken)
    while name in taken:
        name += "_"
    return name


@dataclass
class Chains:
    """Makes elements of joints; knows which joints are motors and what yields."""

    model: UrdfModel
    side: Sidecar
    motors: set[str]
    heads: set[str]
    """First links of the bodies on the ways; what else moves stays with the one that it hangs on."""

    def sequence(self, way: list[UrdfJoint], end: str | None = None) -> tuple[Element, ...]:
        """Elements along joints; the spring of a link stands at its end, before the joint that leaves
        it, that of `end` at the last frame."""
        heads = {j.child for j in way if j.kind != "fixed"}
        bodies = [n for n, body in self.model.links.items() if body and self.carrier(n) in heads]
        self._refuse_alike("joint", [j.name for j in way if j.kind != "fixed" or j.origin != Pose()])
        self._refuse_alike("link", bodies)
        taken = [plain_name(j.name) for j in way if j.kind != "fixed"]
        out: list[Element] = []
        for joint in way:
            if joint.origin != Pose():
                out.append(Offset(free_name(plain_name(f"{joint.name}_origin"), taken), joint.origin))
                taken.append(out[-1].name)
            out += self._spring(joint.parent, end, taken)
            if joint.kind != "fixed":
                out.append(self._joint(joint))
                out += self._bodies(joint.child)
        return (*out, *(self._spring(end, None, taken) if end else ()))

    def _refuse_alike(self, tag: str, names: list[str]) -> None:
        """FileError for two names that are one in a machine file."""
        seen: dict[str, str] = {}
        for name in names:
            other = seen.setdefault(plain_name(name), name)
            if other != name:
                raise FileError(f"'{other}' and '{name}' would both be '{plain_name(name)}' in a machine file, whose names "
                                "are of letters without accents, digits, _ and -; rename one",
                                file=self.model.file, key=tag)  # fmt: skip

    def _spring(self, link: str, end: str | None, taken: list[str]) -> tuple[Element, ...]:
        given = self.side.springs.get(link)
        if given is None or link == end:
            return ()
        return (link_spring(free_name(plain_name(link), taken), given),)

    def _joint(self, joint: UrdfJoint) -> Joint:
        self._check(joint)
        home = self.coordinate(joint)
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

    def _check(self, joint: UrdfJoint) -> None:
        """FileError, one line, for a joint that no way to the tip may hold."""
        problem = ""
        if joint.mimic:
            problem = (f"mimics joint '{joint.mimic.joint}' and lies on the way to the tip: coupled joints cannot "
                       "be imported; make it fixed, or choose a tip before it")  # fmt: skip
        elif joint.kind not in ("revolute", "prismatic"):
            problem = (f"type '{joint.kind}' cannot be imported on the way to the tip; known are revolute, "
                       "continuous, prismatic, fixed")  # fmt: skip
        elif joint.limits and joint.limits[0] > joint.limits[1]:
            problem = f"the lower limit {joint.limits[0]:g} lies above the upper one, {joint.limits[1]:g}"
        if problem:
            raise FileError(problem, file=self.model.file, key=f"joint {joint.name}")

    def coordinate(self, joint: UrdfJoint) -> float:
        """Of a joint at home, m or rad: the sidecar's, or what the joint that it mimics makes of it, or 0."""
        seen, slope, start = [joint], 1.0, 0.0
        while joint.name not in self.side.home and joint.mimic:
            start, slope = start + slope * joint.mimic.offset, slope * joint.mimic.multiplier
            followed = [j for j in self.model.moving if j.name == joint.mimic.joint and j not in seen]
            if not followed:
                return start
            joint = followed[0]
            seen.append(joint)
        return start + slope * self.side.home.get(joint.name, 0.0)

    def carrier(self, link: str) -> str:
        """First link of the body on the ways, or of the base, that a link stays with."""
        while link not in self.heads and link in self.model.above:
            link = self.model.above[link].parent
        return link

    def _bodies(self, head: str) -> list[Body]:
        """Bodies of all links that stay with `head`, seen from its frame, turned about their own centres."""
        out = []
        for link, body in self.model.links.items():
            if body is None or self.carrier(link) != head:
                continue
            at = self.between(head, link)
            turned = at.r @ np.array(body.inertia) @ at.r.T
            com = at.p + at.r @ np.array(body.com)
            rows = tensor(turned, body.mass)
            least = float(np.linalg.eigvalsh(rows)[0])
            if least < -DUST * np.abs(rows).max():
                raise FileError(f"the inertia has a negative principal moment ({least:.3g} kg m^2)",
                                file=self.model.file, key=f"link {link}")  # fmt: skip
            out.append(Body(plain_name(link), body.mass, Pose.of(com).translation, rows))
        return out

    def between(self, head: str, link: str) -> Pose:
        """A link's frame at home, seen from that of a link below which it hangs."""
        out = Pose()
        while link != head:
            joint = self.model.above[link]
            moved = moved_by(joint.kind, joint.axis, self.coordinate(joint))
            out, link = joint.origin @ moved @ out, joint.parent
        return out


def link_spring(name: str, given: LinkSpring) -> Spring:
    """Six diagonal terms or six rows."""
    values = given.stiffness if given.stiffness is not None else given.compliance
    array = np.array(values, dtype=float)
    rows = as_rows(np.diag(array) if array.ndim == 1 else array)
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
                out = out @ moved_by(e.kind, axis, q)
    return out


def moved_by(kind: str, axis: Vector, q: float) -> Pose:
    """What a joint's coordinate (m, rad) moves: about or along its axis."""
    if q == 0:
        return Pose()
    along = np.array(axis)
    return Pose.of(q * along) if kind == "prismatic" else Pose.of(rotation=rotation_about(along, q))
