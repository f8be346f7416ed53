"""The lines and joints of a machine at a configuration, from its mechanism's frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.model.description import Joint
from stiffmap.model.description.tree import joints
from stiffmap.solve.compiled import CompiledMachine, Role
from stiffmap.solve.machine import Machine

COINCIDENT = 1e-9


@dataclass(frozen=True)
class Skeleton:
    """Polylines and points in base axes, m."""

    links: list[tuple[str, Floats]]
    """Leg ("" for base and platform) and the two ends (2, 3) of each rigid piece."""
    guides: list[tuple[str, Floats]]
    """Leg and travel (2, 3) of each prismatic actuator."""
    actuators: Floats
    """(n, 3)."""
    passive: Floats
    """(n, 3)."""
    tcp: Floats
    """(3,)."""
    platform: Floats
    """(n, 3) where its legs hold the platform (`plate` puts them in order); none where these are
    not corners of a plate at home."""
    ends: tuple[int, ...]
    """The node of the mechanism at which each link ends."""

    @property
    def points(self) -> Floats:
        """(n, 3) ends of everything that is drawn."""
        ends = [e for _, e in (*self.links, *self.guides)]
        return np.concatenate([*ends, self.platform, self.tcp[None]]) if ends else self.tcp[None]


def skeleton(machine: Machine, coordinates: Floats, *, shortest: float = COINCIDENT) -> Skeleton:
    """Geometry to draw at coordinates (springs at rest, or deflected); pieces that are not longer than
    `shortest` (m) are left out."""
    core = machine.compiled
    position, rotation = core.frames(coordinates)
    owner = owners(core)
    named = joints(machine.description)
    held = held_by(core)
    at_home, _ = core.frames(
        core.home_coordinates()
    )  # it decides, so that the pieces are the same at all coordinates
    corners = position[sorted(held)]
    if not len(plate(at_home[sorted(held)])):
        corners, held = np.zeros((0, 3)), set()
    body = beyond(core, held)
    links, guides, ends, marks = [], [], [], {Role.ACTUATOR: [], Role.PASSIVE: []}  # type: ignore[var-annotated]
    for i, (parent, c) in enumerate(core.nodes):
        role = core.names.roles[c] if c >= 0 else None
        if role in marks:
            marks[role].append(position[i])
        joint = named.get(core.names.coordinates[c]) if c >= 0 else None
        if joint is not None and joint.kind == "prismatic" and not _moves(core, parent):
            guides.append((owner[i], travel(joint, float(coordinates[c]), position[i], rotation[i])))
        elif (
            parent >= 0
            and np.linalg.norm(position[i] - position[parent]) > shortest
            and parent != 0
            and i not in body
        ):
            links.append((owner[i], position[[parent, i]]))
            ends.append(i)
    empty = np.zeros((0, 3))
    return Skeleton(
        links, guides, np.array(marks[Role.ACTUATOR]).reshape(-1, 3) if marks[Role.ACTUATOR] else empty,
        np.array(marks[Role.PASSIVE]).reshape(-1, 3) if marks[Role.PASSIVE] else empty, position[-1], corners, tuple(ends),
    )  # fmt: skip


def held_by(core: CompiledMachine) -> set[int]:
    """Nodes at which legs in parallel end in the platform: the last joints of their branches."""
    if len(core.names.legs) < 2:
        return set()
    owner = owners(core)
    last = set[int]()
    for i, (parent, c) in enumerate(core.nodes):
        if c < 0 or not owner[i]:
            continue
        last.add(i)
        while parent >= 0 and owner[parent] == owner[i]:
            last.discard(parent)
            parent = core.nodes[parent][0]
    return last


def beyond(core: CompiledMachine, held: set[int]) -> set[int]:
    """Nodes of the legs that the platform carries: behind the last joints."""
    owner = owners(core)
    out = set[int]()
    for i, (parent, _) in enumerate(core.nodes):
        if owner[i] and (parent in held or parent in out):
            out.add(i)
    return out


def plate(points: Floats) -> Floats:
    """Points (n, 3) that span a plate, in order around its middle; none where they do not."""
    if len(points) < 3:
        return np.zeros((0, 3))
    away = points - points.mean(axis=0)
    _, sizes, axes = np.linalg.svd(away, full_matrices=False)
    if sizes[1] < 1e-3 * sizes[0] or sizes[2] > 0.5 * sizes[1]:
        return np.zeros((0, 3))
    return np.asarray(points[np.argsort(np.arctan2(away @ axes[1], away @ axes[0]))])


def _moves(core: CompiledMachine, node: int) -> bool:
    """Whether a joint lies below a node: a prismatic one above it is a strut, not a guide."""
    while node >= 0:
        parent, c = core.nodes[node]
        if c >= 0 and core.names.roles[c] in (Role.ACTUATOR, Role.PASSIVE):
            return True
        node = parent
    return False


def owners(core: CompiledMachine) -> list[str]:
    """Leg that each node belongs to: that of its own coordinate, else its parent's."""
    out: list[str] = []
    last = max((end for block, _, _, end in core.loops if block == "legs"), default=len(core.nodes))
    for i, (parent, c) in enumerate(core.nodes):
        own = core.names.coordinates[c].split(".")[0] if c >= 0 else ""
        inherited = out[parent] if parent >= 0 and i <= last else ""
        out.append(own if own in core.names.legs else inherited)
    return out


def travel(joint: Joint, value: float, position: Floats, rotation: Floats) -> Floats:
    """Ends (2, 3) of a prismatic joint's range; where none is declared, from its zero to where it is."""
    low, high = (joint.drive.range if joint.drive else None) or joint.limits or (0.0, value)
    axis = rotation @ np.array(joint.axes[0])
    return np.stack([position + axis * (low - value), position + axis * (high - value)])
