"""What of a machine is drawn at a configuration: lines and joints, from its mechanism's frames; which of them belong to an element,
and how thick the links are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import place_text
from stiffmap.model.description import Joint, Spring
from stiffmap.model.description.tree import all_elements, core_name, joints
from stiffmap.solve.compiled import CompiledMachine, Role, Status
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.machine import Machine
from stiffmap.workspace.maps.inputs import place

COINCIDENT = 1e-9
FLAT = 1e-6  # m


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Lines and points in base axes, m: all pictures of a machine draw these; the same pieces at all its coordinates."""

    legs: tuple[str, ...]
    """Leg of each link; empty for base and platform, whose rim comes last."""
    links: Floats
    """(n, 2, 3) the two ends of each rigid piece."""
    guides: Floats
    """(m, 2, 3) travel of the drives that slide."""
    actuators: Floats
    """(k, 3)."""
    passive: Floats
    """(k, 3)."""
    tcp: Floats
    """(3,)."""
    plate: Floats
    """(n, 3) corners of the platform where its legs hold it, in order around its middle; none where these span no plate
    at home."""
    ends: tuple[int, ...]
    """The node of the mechanism at which each link but those of the rim ends."""
    coordinates: Floats
    """All of the machine, m and rad."""

    @property
    def bars(self) -> list[tuple[str, Floats]]:
        """Leg and ends (2, 3) of each link that has a length, without the rim."""
        bars = zip(self.legs, self.links[: len(self.ends)], strict=False)
        return [(leg, ends) for leg, ends in bars if np.linalg.norm(ends[1] - ends[0]) > COINCIDENT]

    @property
    def points(self) -> Floats:
        """(n, 3) ends of everything that is drawn."""
        return np.concatenate([self.links.reshape(-1, 3), self.guides.reshape(-1, 3), self.tcp[None]])

    @property
    def extent(self) -> float:
        """Diagonal of the box around everything, m."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    @property
    def is_flat(self) -> bool:
        """Whether everything lies in one plane of constant z."""
        return float(np.ptp(self.points[:, 2])) < FLAT

    def enlarged(self, loaded: Skeleton, factor: float) -> Skeleton:
        """With the way of every frame to a loaded skeleton times the factor."""
        moving = ("links", "actuators", "passive", "tcp", "plate")
        ways = {n: getattr(self, n) + factor * (getattr(loaded, n) - getattr(self, n)) for n in moving}
        return replace(self, **ways)


def standing(
    machine: Machine,
    position: ArrayLike | None = None,
    rotation: ArrayLike | None = None,
    *,
    start: ArrayLike | None = None,
) -> Skeleton:
    """The machine at a commanded TCP pose (m, base axes; None: home), springs at rest; StiffmapError out of its reach."""
    p = machine.description.home.p if position is None else place(position)
    k = inverse_kinematics(machine, p, rotation, start=start, threads=1)
    if int(k.status) != Status.CONVERGED:
        raise StiffmapError(
            f"position: {machine.name} cannot be drawn at {place_text(p)}: {Status(int(k.status)).name}"
        )
    return skeleton(machine, k.coordinates)


def skeleton(machine: Machine, coordinates: Floats) -> Skeleton:
    """What is drawn at coordinates, springs at rest or deflected."""
    core = machine.compiled
    position, rotation = core.frames(coordinates)
    owner = owners(core)
    named = joints(machine.description)
    held = sorted(held_by(core))
    # home decides, so that the pieces are the same at all coordinates
    order = around(core.frames(core.home_coordinates())[0][held])
    body = beyond(core, set(held) if len(order) else set())
    legs, links, guides, ends = [], [], [], []
    marks: dict[Role | None, list[Floats]] = {Role.ACTUATOR: [], Role.PASSIVE: []}
    for i, (parent, c) in enumerate(core.nodes):
        role = core.names.roles[c] if c >= 0 else None
        if role in marks:
            marks[role].append(position[i])
        joint = named.get(core.names.coordinates[c]) if c >= 0 else None
        if joint is not None and joint.kind == "prismatic" and not _moves(core, parent):
            guides.append(travel(joint, float(coordinates[c]), position[i], rotation[i]))
        elif parent > 0 and i not in body:
            legs.append(owner[i])
            links.append(position[[parent, i]])
            ends.append(i)
    tcp, corners = position[-1], position[held][order]
    if len(corners):  # its edges, and from its middle to the TCP
        links += [np.stack(pair) for pair in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
        links.append(np.stack([corners.mean(axis=0), tcp]))
        legs += [""] * (len(corners) + 1)
    drives, passive = (np.array(marks[r]).reshape(-1, 3) for r in (Role.ACTUATOR, Role.PASSIVE))
    pieces, ways = (np.array(v).reshape(-1, 2, 3) for v in (links, guides))
    return Skeleton(tuple(legs), pieces, ways, drives, passive, tcp, corners, tuple(ends), coordinates)


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
        last -= {n for n in to_base(core, parent) if owner[n] == owner[i]}
    return last


def beyond(core: CompiledMachine, held: set[int]) -> set[int]:
    """Nodes of the legs that the platform carries: behind the last joints."""
    owner = owners(core)
    out = set[int]()
    for i, (parent, _) in enumerate(core.nodes):
        if owner[i] and (parent in held or parent in out):
            out.add(i)
    return out


def around(points: Floats) -> NDArray[np.intp]:
    """Order in which points (n, 3) that span a plate stand around its middle; none where they do not."""
    none = np.zeros(0, np.intp)
    if len(points) < 3:
        return none
    away = points - points.mean(axis=0)
    _, sizes, axes = np.linalg.svd(away, full_matrices=False)
    if sizes[1] < 1e-3 * sizes[0] or sizes[2] > 0.5 * sizes[1]:
        return none
    return np.argsort(np.arctan2(away @ axes[1], away @ axes[0]))


def to_base(core: CompiledMachine, node: int) -> Iterator[int]:
    """The node itself and those below it, towards the base."""
    while node >= 0:
        yield node
        node = core.nodes[node][0]


def _moves(core: CompiledMachine, node: int) -> bool:
    """Whether a joint lies below a node: a prismatic one above it is a strut, not a guide."""
    coordinates = [core.nodes[i][1] for i in to_base(core, node)]
    return any(c >= 0 and core.names.roles[c] in (Role.ACTUATOR, Role.PASSIVE) for c in coordinates)


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


THICK, THIN = 0.02, 0.004  # of the machine's extent: most and least thickness of a link
PLAIN = 0.008  # the same of a link of which no spring says a section


def thicknesses(machine: Machine, now: Skeleton) -> Floats:
    """(links,) m: of each link the diameter of the round bar whose axial and bending compliances have the ratio
    that the spring behind it has, whatever it is made of; a plain one where no spring says it."""
    core = machine.compiled
    size = now.extent
    out = np.full(len(now.links), PLAIN * size)
    springs = {
        core_name(n): np.array(e.compliance)
        for n, e in all_elements(machine.description)
        if isinstance(e, Spring) and e.compliance is not None
    }
    position, rotation = core.frames(core.home_coordinates())
    first = _first_spring(core)
    for k, i in enumerate(now.ends):
        name = first.get(i)
        d = position[i] - position[core.nodes[i][0]]
        length = float(np.linalg.norm(d))
        if name not in springs or length < 1e-6:
            continue
        c = springs[name]
        a = rotation[i].T @ d / length
        axial = float(a @ c[:3, :3] @ a)
        bending = (float(np.trace(c[3:, 3:])) - float(a @ c[3:, 3:] @ a)) / 2
        if axial > 0 and bending > 0:
            out[k] = 4 * np.sqrt(axial / bending)
    return np.asarray(np.clip(out, THIN * size, THICK * size))


def _first_spring(core: CompiledMachine) -> dict[int, str]:
    """Frame -> the link spring that begins right behind it."""
    out: dict[int, str] = {}
    for parent, c in core.nodes:
        if c >= 0 and core.names.roles[c] == Role.SPRING:
            name = core.names.coordinates[c].rpartition(".")[0]
            if core.names.springs.get(name) == c:
                out.setdefault(parent, name)
    return out


def nodes_of(core: CompiledMachine, element: str, legs: Sequence[str] = ()) -> dict[int, str]:
    """Nodes of the mechanism with an element's coordinates, in these legs (none: in any), and its full name there; where
    it has no coordinates of its own, those of the element that its name begins with (``bar`` for ``bar.k33``)."""
    wanted = element.split(".")
    for n in range(len(wanted), 0, -1):
        names = {i: _name(core, c, wanted[:n], legs) for i, (_, c) in enumerate(core.nodes) if c >= 0}
        found = {i: name for i, name in names.items() if name}
        if found or wanted[0] in core.names.legs:
            return found
    return {}


def _name(core: CompiledMachine, coordinate: int, wanted: list[str], legs: Sequence[str]) -> str:
    """A coordinate's name up to an element that it belongs to; empty where it does not."""
    parts, n = core.names.coordinates[coordinate].split("."), len(wanted)
    if legs and parts[0] not in legs:
        return ""
    return next((".".join(parts[: k + n]) for k in range(len(parts)) if parts[k : k + n] == wanted), "")


def element_links(machine: Machine, element: str, legs: Sequence[str] = ()) -> list[int]:
    """Which links of a skeleton lie just before an element: they are lit when it is chosen or named. An element in both
    branches of a parallelogram is two."""
    core = machine.compiled
    position, _ = core.frames(core.home_coordinates())
    drawn = {node: k for k, node in enumerate(skeleton(machine, core.home_coordinates()).ends)}
    firsts = {name: i for i, name in reversed(nodes_of(core, element, legs).items())}
    out = dict[int, None]()
    for first in reversed(firsts.values()):
        for i in (*to_base(core, first), *_chain_up(core, first)):
            parent = core.nodes[i][0]
            if i in drawn and parent >= 0 and np.linalg.norm(position[i] - position[parent]) > 1e-6:
                out[drawn[i]] = None
                break
    return list(out)


def _chain_up(core: CompiledMachine, node: int) -> list[int]:
    """Frames behind it in its own leg."""
    legs = owners(core)
    children = {parent: i for i, (parent, _) in reversed(list(enumerate(core.nodes)))}
    out = []
    while node in children and legs[children[node]] == legs[node]:
        node = children[node]
        out.append(node)
    return out
