"""Which drawn pieces of a machine belong to an element, and how thick its links are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.model.description import Spring
from stiffmap.model.description.tree import all_elements, core_name
from stiffmap.solve.compiled import CompiledMachine, Role
from stiffmap.solve.machine import Machine
from stiffmap.ui.plot.skeleton import Skeleton, owners, skeleton, to_base

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
