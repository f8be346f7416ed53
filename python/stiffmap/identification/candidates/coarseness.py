"""Which of several candidates that show the same has the name: the coarsest physical part."""

from __future__ import annotations

from stiffmap.identification.candidates.candidates import Candidate
from stiffmap.model.description import Joint, MachineDescription
from stiffmap.model.description.tree import sequences
from stiffmap.model.effects import registry


def coarseness(
    candidate: Candidate, rank: int, description: MachineDescription
) -> tuple[int, bool, int, int]:
    """Sort key: fewest directions, constant before what a reversal of load would show, then drive, whole
    link or body, joint, offset, single entry; then kind."""
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
