"""Names of what a compiled mechanism is made of, asked once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from stiffmap._core import Mechanism

PASSIVE, SPRING = 1, 2  # roles of coordinates in the core


@dataclass(frozen=True)
class Names:
    """In the order of the core; springs and joints with the index of their (first) coordinate."""

    actuators: tuple[str, ...]
    legs: tuple[str, ...]
    points: tuple[str, ...]
    coordinates: tuple[str, ...]
    free_spins: tuple[str, ...]
    springs: Mapping[str, int]
    joints: Mapping[str, int]


def names_of(core: Mechanism) -> Names:
    """All names of a mechanism."""
    coordinates, roles = tuple(core.coordinates), core.roles
    return Names(
        actuators=tuple(n for n, _ in core.actuators),
        legs=tuple(core.legs),
        points=tuple(core.points),
        coordinates=coordinates,
        free_spins=tuple(
            n for n, held, r in zip(coordinates, core.locked, roles, strict=True) if held and r == PASSIVE
        ),
        springs=dict(core.springs),
        joints={n: i for i, (n, r) in enumerate(zip(coordinates, roles, strict=True)) if r != SPRING},
    )
