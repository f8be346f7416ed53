"""What is drawn of a machine, as plain arrays: SI, base axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.model.description import Spring
from stiffmap.model.description.tree import all_elements
from stiffmap.solve.compiled import CompiledMachine, Role
from stiffmap.solve.machine import Machine
from stiffmap.ui.plot.skeleton import Skeleton, held_by, owners, plate, skeleton

THICK, THIN = 0.02, 0.004
"""Of the machine's extent: most and least thickness of a link."""
PLAIN = 0.008
"""The same of a link of which no spring says a section."""


@dataclass(frozen=True, eq=False)
class Drawing:
    """Pieces of the machine; the order of links is the same at all coordinates."""

    legs: tuple[str, ...]
    """Leg of each link; empty for base and platform, whose rim comes last."""
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
    plate: Floats
    """(n, 3) corners of the platform, in order around its middle; none where it is no plate."""
    ends: tuple[int, ...]
    """The node of the mechanism at which each link but those of the rim ends."""

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
    corners = s.platform[_around(machine)] if len(s.platform) else s.platform
    links = np.array([ends for _, ends in s.links] + _rim(corners, s.tcp)).reshape(-1, 2, 3)
    legs = tuple(leg for leg, _ in s.links)
    legs += ("",) * (len(links) - len(legs))
    guides = np.array([ends for _, ends in s.guides]).reshape(-1, 2, 3)
    return Drawing(legs, links, guides, s.actuators, s.passive, s.tcp, corners, s.ends)


def _around(machine: Machine) -> list[int]:
    """The platform's corners in order around its middle, the same at all coordinates: that of home."""
    core = machine.compiled
    position, _ = core.frames(core.home_coordinates())
    corners = position[sorted(held_by(core))]
    ordered = plate(corners)
    return [int(np.flatnonzero((corners == p).all(axis=1))[0]) for p in ordered]


def _rim(corners: Floats, tcp: Floats) -> list[Floats]:
    """Edges of the platform, and from its middle to the TCP."""
    if not len(corners):
        return []
    edges = [np.stack(pair) for pair in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    return [*edges, np.stack([corners.mean(axis=0), tcp])]


def thicknesses(machine: Machine, now: Drawing) -> Floats:
    """(links,) m: of each link the diameter of the round bar whose axial and bending compliances have the ratio
    that the spring behind it has, whatever it is made of; a plain one where no spring says it."""
    core = machine.compiled
    size = now.extent
    out = np.full(len(now.links), PLAIN * size)
    springs = _springs(machine)
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


def _springs(machine: Machine) -> dict[str, Floats]:
    """Compliance (6, 6) of the link springs that declare one, by their names in the core."""
    from stiffmap.model.description.tree import core_name

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
    drawn = {node: k for k, node in enumerate(drawing(machine, core.home_coordinates()).ends)}
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
