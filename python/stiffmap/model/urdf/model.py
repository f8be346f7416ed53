"""A URDF as a tree of links and joints (SI), and its tool where nobody names it."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError, suggestion
from stiffmap.common.short import first_of
from stiffmap.model.description import Body, Pose
from stiffmap.model.description.pose import Rows, Vector

DUST, POINT = 1e-12, 1e-15
"""Of the largest term of a tensor: what turning it leaves where there is nothing. m²: a tensor less than this times its mass
is that of a point, which exporters write with rounding."""


def tensor(values: Floats, mass: float) -> Rows:
    """Symmetric tensor (kg·m²) of a body (kg) as rows, without numerical dust."""
    even = (values + values.T) / 2
    size = np.abs(even)
    return Pose.of(rotation=np.where(size < max(DUST * size.max(), POINT * mass), 0.0, even)).rotation


@dataclass(frozen=True)
class Mimic:
    """The joint that another follows: coordinate = multiplier · its coordinate + offset."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True)
class UrdfJoint:
    """A joint: its frame in the parent link's frame, then its motion."""

    name: str
    kind: str  # revolute, prismatic, fixed; others as written, and never on a way to the tip
    parent: str
    child: str
    origin: Pose
    rpy: Vector = (0.0, 0.0, 0.0)  # of the origin, as written
    axis: Vector = (1.0, 0.0, 0.0)
    limits: tuple[float, float] | None = None
    effort: float | None = None
    velocity: float | None = None
    mimic: Mimic | None = None


@dataclass(frozen=True)
class UrdfModel:
    """Links with their bodies (None: no mass), and the joint above each link but the root."""

    file: str
    name: str
    links: dict[str, Body | None]
    above: dict[str, UrdfJoint] = field(default_factory=dict)

    @property
    def root(self) -> str:
        """The link without a joint above."""
        return next(link for link in self.links if link not in self.above)

    @property
    def leaves(self) -> list[str]:
        """Links that carry no other link."""
        parents = {joint.parent for joint in self.above.values()}
        return [link for link in self.links if link not in parents]

    @property
    def moving(self) -> list[UrdfJoint]:
        """Joints that are not fixed, in the file's order."""
        return [joint for joint in self.above.values() if joint.kind != "fixed"]

    @property
    def joints(self) -> dict[str, UrdfJoint]:
        """All joints by their names."""
        return {joint.name: joint for joint in self.above.values()}

    def way(self, link: str) -> list[UrdfJoint]:
        """Joints from the root to a link."""
        out: list[UrdfJoint] = []
        while link in self.above:
            out.append(self.above[link])
            link = self.above[link].parent
        return out[::-1]

    def body_of(self, link: str) -> str:
        """The first link of the rigid body that a link belongs to: fixed joints do not move."""
        while link in self.above and self.above[link].kind == "fixed":
            link = self.above[link].parent
        return link

    def link(self, name: str, what: str, file: str) -> str:
        """The link that a frame name means: a link, or the link below a joint of that name."""
        if name in self.links:
            return name
        if name in self.joints:
            return self.joints[name].child
        near = suggestion(name, [*self.links, *self.joints])
        raise FileError(f"no frame '{name}' in {self.file}{near}", file=file, key=what)


TOOLS = (r"tool_?0", r"tcp|tool_cent(er|re)_point", r"tool\d*", r"eef?|end_?effector", r"flange",
         r"grasp(ing)?(_?(frame|center|target|point))?|gripper_frame")  # fmt: skip
"""Names of tools as makers write them, alone or as words of a longer name; the first is the surest."""


JAW = r"(?!.*(wrist|rot|roll|pitch|yaw|tilt)).*(grip|jaw|claw)"
"""Names of joints that open a gripper, not of those that turn one."""


def rank(link: str) -> int:
    """Place of a link's name in TOOLS; that after the last for a name that says nothing."""
    words = re.sub(r"([a-z])([A-Z])", r"\1_\2", link).lower()
    found = (i for i, name in enumerate(TOOLS) if re.search(rf"(?<![a-z0-9])({name})(?![a-z0-9])", words))
    return next(found, len(TOOLS))


def find_tip(model: UrdfModel) -> tuple[str, str]:
    """The link that is the tool, and in words the ends that it was chosen from ('' for an only end).

    An end is a leaf that a moving joint carries. Tools are known by their names; otherwise the tool is on the
    only body that carries no other, jaws apart. FileError, one line, where several arms are left.
    """
    ends = [n for n in model.leaves if model.body_of(n) != model.root]
    if not ends:
        raise FileError("no joint moves, so there is no machine", file=model.file)
    if len(ends) == 1 and not _jaws(model):
        return ends[0], ""
    found = _named(ends) or _by_bodies(model, ends)
    longest = max((model.way(n) for n in found), key=len)
    along = {model.root, *(j.child for j in longest)}
    if not all(model.body_of(n) in along for n in found):
        raise FileError(f"the tree has {len(found)} ends ({first_of(found)}); say which one is the tool: --tip LINK, "
                        "or tip in Python and in a sidecar", file=model.file)  # fmt: skip
    tip = min(found, key=lambda n: (rank(n), -len(model.way(n))))
    return tip, f"chosen from the ends {first_of(ends)}"


def _named(links: list[str]) -> list[str]:
    return [n for n in links if rank(n) < len(TOOLS)]


def _by_bodies(model: UrdfModel, ends: list[str]) -> list[str]:
    """Links from which the tool is chosen where no end has the name of one."""
    jaws = _jaws(model)
    hands = [model.joints[name].parent for name in jaws]
    moving = [j for j in model.moving if not any(k.name in jaws for k in model.way(j.child))]
    carriers = {model.body_of(j.parent) for j in moving}
    last = [j.child for j in moving if j.child not in carriers]
    on = {body: [n for n in model.links if model.body_of(n) == body] for body in last}
    if len(last) == 1:
        (here,) = on.values()
        return _named(here) or [n for n in here if n in hands] or [n for n in here if n in ends]
    shared = [n for n in model.links if all(n in (j.parent for j in model.way(body)) for body in last)]
    each = ([n for n in here if n in ends] or [n for n in here if n in hands] for here in on.values())
    return _named(shared) or [n for few in each for n in few]


def _jaws(model: UrdfModel) -> set[str]:
    """Joints of jaws and rods: on a moving body with other joints, and behind each at most one joint that follows no
    other; two such are jaws, one that mimics is a rod. A joint alone is a jaw where its name says so."""
    below: dict[str, list[str]] = {}
    for joint in model.moving:
        if model.body_of(joint.parent) != model.root and _independent(model, joint.child) <= 1:
            below.setdefault(model.body_of(joint.parent), []).append(joint.name)
    on = [model.body_of(j.parent) for j in model.moving]
    return {name for body, names in below.items() for name in names
            if len(names) > 1 or (on.count(body) > 1 and model.joints[name].mimic) or _opens(model, name)}  # fmt: skip


def _opens(model: UrdfModel, joint: str) -> bool:
    """True for a joint that is named like a gripper's, does not turn one, and hangs on a joint of another name."""
    way = [j.name.lower() for j in model.way(model.joints[joint].child) if j.kind != "fixed"][-2:]
    return [bool(re.match(JAW, name)) for name in way] == [False, True]


def _independent(model: UrdfModel, link: str) -> int:
    """How many joints that mimic no other lie above and behind a link, its own included."""
    return sum(j.mimic is None and any(k.child == link for k in model.way(j.child)) for j in model.moving)
