"""What is drawn of a machine, as plain arrays: SI, base axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stiffmap.broadcasting import Floats
from stiffmap.compiled import CompiledMachine, Role
from stiffmap.description import Spring
from stiffmap.description.tree import all_elements
from stiffmap.machine import Machine
from stiffmap.plot.skeleton import Skeleton, owners, skeleton

THICK, THIN = 0.02, 0.004
"""Of the machine's extent: most and least thickness of a link."""
PLAIN = 0.008
"""The same of a link of which no spring says a section."""


@dataclass(frozen=True, eq=False)
class Drawing:
    """Pieces of the machine; the order of links is the same at all coordinates."""

    legs: tuple[str, ...]
    """Leg of each link; empty for base and platform."""
    links: Floats
    """(n, 2, 3)."""
    guides: Floats
    """(m, 2, 3) travel of the drives that slide."""
    actuators: Floats
    """(k, 3)."""
    passive: Floats
    """(k, 3)."""
    tcp: Floats
    """(3,)."""

    @property
    def extent(self) -> float:
        """Diagonal of the box around everything, m."""
        points = np.concatenate([self.links.reshape(-1, 3), self.guides.reshape(-1, 3), self.tcp[None]])
        return float(np.linalg.norm(np.ptp(points, axis=0)))

    def enlarged(self, loaded: Drawing, factor: float) -> Floats:
        """(n, 2, 3) links with their way to a loaded drawing times the factor."""
        return np.asarray(self.links + factor * (loaded.links - self.links))


def drawing(machine: Machine, coordinates: Floats) -> Drawing:
    """Geometry at coordinates, every rigid piece with the same place in every drawing of the machine."""
    s: Skeleton = skeleton(machine, coordinates, shortest=-1.0)
    links = np.array([ends for _, ends in s.links]).reshape(-1, 2, 3)
    guides = np.array([ends for _, ends in s.guides]).reshape(-1, 2, 3)
    return Drawing(tuple(leg for leg, _ in s.links), links, guides, s.actuators, s.passive, s.tcp)


def thicknesses(machine: Machine, now: Drawing) -> Floats:
    """(links,) m: of each link the diameter of the round bar whose axial and bending compliances have the ratio
    that the spring behind it has, whatever it is made of; a plain one where no spring says it."""
    core = machine.compiled
    size = now.extent
    out = np.full(len(now.links), PLAIN * size)
    springs = _springs(machine)
    position, rotation = core.frames(core.home_coordinates())
    first = _first_spring(core)
    k = -1
    for i in _drawn(machine):
        k += 1
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


def _drawn(machine: Machine) -> list[int]:
    """The frames at which the links of a skeleton end, in its order."""
    from stiffmap.description.tree import joints
    from stiffmap.plot.skeleton import _moves

    core = machine.compiled
    named = joints(machine.description)
    out = []
    for i, (parent, c) in enumerate(core.nodes):
        joint = named.get(core.names.coordinates[c]) if c >= 0 else None
        guide = joint is not None and joint.kind == "prismatic" and not _moves(core, parent)
        if not guide and parent > 0:
            out.append(i)
    return out


def _springs(machine: Machine) -> dict[str, Floats]:
    """Compliance (6, 6) of the link springs that declare one, by their names in the core."""
    from stiffmap.description.tree import core_name

    return {
        core_name(n): np.array(e.compliance)
        for n, e in all_elements(machine.description)
        if isinstance(e, Spring) and e.compliance is not None
    }


def _first_spring(core: CompiledMachine) -> dict[int, str]:
    """Frame -> the link spring that begins right behind it."""
    out: dict[int, str] = {}
    for parent, c in core.nodes:
        if c >= 0 and core.names.roles[c] == Role.SPRING:
            name = core.names.coordinates[c].rpartition(".")[0]
            if core.names.springs.get(name) == c:
                out.setdefault(parent, name)
    return out


def element_links(machine: Machine, element: str) -> list[int]:
    """Which links of a drawing lie just before an element: they are lit when its share is chosen."""
    core = machine.compiled
    first = next(
        (i for i, (_, c) in enumerate(core.nodes) if c >= 0 and _is_of(core.names.coordinates[c], element)),
        None,
    )
    if first is None:
        return []
    position, _ = core.frames(core.home_coordinates())
    drawn = {node: k for k, node in enumerate(_drawn(machine))}
    around = [*_chain_down(core, first), *_chain_up(core, first)]
    for i in around:
        parent = core.nodes[i][0]
        if i in drawn and parent >= 0 and np.linalg.norm(position[i] - position[parent]) > 1e-6:
            return [drawn[i]]
    return []


def _is_of(coordinate: str, element: str) -> bool:
    return coordinate == element or coordinate.rpartition(".")[0] == element


def _chain_down(core: CompiledMachine, node: int) -> list[int]:
    """The frame itself and those towards the base."""
    out = []
    while node > 0:
        out.append(node)
        node = core.nodes[node][0]
    return out


def _chain_up(core: CompiledMachine, node: int) -> list[int]:
    """Frames behind it in its own leg."""
    legs = owners(core)
    children = {parent: i for i, (parent, _) in reversed(list(enumerate(core.nodes)))}
    out = []
    while node in children and legs[children[node]] == legs[node]:
        node = children[node]
        out.append(node)
    return out
