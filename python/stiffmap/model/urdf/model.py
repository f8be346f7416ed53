"""A URDF as a tree of links and joints (SI)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError, suggestion
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
