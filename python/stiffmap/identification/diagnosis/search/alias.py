"""Structural aliases: candidates that this plan cannot distinguish, before any reading is looked at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stiffmap.experiment.experiment import Floats
from stiffmap.identification.diagnosis.candidates.candidates import Candidate
from stiffmap.identification.diagnosis.search.screen import Screen
from stiffmap.model.description import Joint, MachineDescription
from stiffmap.model.description.tree import sequences
from stiffmap.model.effects import registry

LARGEST, DETECTABLE = 20.0, 3.0
"""Two effects are aliases where even an effect of 20 times the noise (rms) leaves a difference of less
than 3 standard deviations."""


@dataclass(frozen=True)
class AliasClass:
    """Candidates with the same signature; the representative is the coarsest physical part."""

    representative: Candidate
    members: tuple[Candidate, ...] = ()
    generalisations: tuple[Candidate, ...] = ()
    """Candidates with more parameters that contain the representative's signature."""


def alias_classes(screen: Screen, description: MachineDescription) -> list[AliasClass]:
    """Classes of the visible candidates; those with several shapes (periods) stand alone."""
    tolerance = DETECTABLE / (LARGEST * np.sqrt(screen.readings))
    single = [i for i in range(len(screen.variants)) if screen.rank[i] and not screen.variants[i].shape]
    order = sorted(
        single, key=lambda i: coarseness(screen.variants[i].candidate, int(screen.rank[i]), description)
    )
    if not order:
        return []
    gap = containment(screen, order)
    out, taken = [], set()
    for a, i in enumerate(order):
        if i in taken:
            continue
        inside = [b for b in range(len(order)) if b != a and gap[a, b] < tolerance**2]
        same = [
            b for b in inside if screen.rank[order[b]] == screen.rank[i] and same_way(screen, i, order[b])
        ]
        more = [b for b in inside if screen.rank[order[b]] > screen.rank[i]]
        free = [order[b] for b in same if order[b] not in taken]
        taken |= {i, *free}
        out.append(
            AliasClass(
                screen.variants[i].candidate,
                tuple(screen.variants[k].candidate for k in free),
                tuple(screen.variants[order[b]].candidate for b in more),
            )
        )
    shaped = {
        id(v.candidate): v.candidate for i, v in enumerate(screen.variants) if v.shape and screen.rank[i]
    }
    return out + [AliasClass(c) for c in shaped.values()]


def containment(screen: Screen, order: Sequence[int]) -> Floats:
    """(A, A) squared sines summed over the directions of a that b does not contain."""
    q = np.hstack([screen.basis(i) for i in order])
    owner = np.repeat(np.arange(len(order)), [screen.rank[i] for i in order])
    squares = (q.T @ q) ** 2
    edges = np.flatnonzero(np.diff(owner, prepend=-1))
    shared = np.add.reduceat(np.add.reduceat(squares, edges, axis=0), edges, axis=1)
    return np.asarray(np.maximum(screen.rank[list(order)][:, None] - shared, 0.0))


def same_way(screen: Screen, i: int, j: int) -> bool:
    """False where both can only grow, one against the other."""
    a, b = screen.variants[i], screen.variants[j]
    if a.sign.size != 1 or b.sign.size != 1 or not (a.sign[0] and b.sign[0]):
        return True
    return bool(float(screen.columns(i)[:, 0] @ screen.columns(j)[:, 0]) * a.sign[0] * b.sign[0] > 0)


def coarseness(
    candidate: Candidate, rank: int, description: MachineDescription
) -> tuple[int, bool, int, int]:
    """Sort key: fewest parameters, constant before what a reversal of load would show, then drive, then whole
    link or body, joint, single entry; then kind."""
    kind = candidate.kind
    part = _part(candidate.element, description)
    return (rank, registry.get(kind).reverses, part, registry.kinds().index(kind))


def _part(element: str, description: MachineDescription) -> int:
    if "." in element:
        return 4
    found = [e for g in description.legs for s in sequences(g.elements) for e in s if e.name == element]
    if any(isinstance(e, Joint) and e.actuated for e in found):
        return 0
    kinds = {type(e).__name__ for e in found}
    return 1 if "Spring" in kinds or not found else 2 if "Joint" in kinds else 3
