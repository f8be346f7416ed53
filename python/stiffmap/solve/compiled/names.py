"""Names of what a compiled mechanism is made of, asked once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum

from stiffmap._core import Mechanism


class Role(IntEnum):
    """What a coordinate belongs to."""

    ACTUATOR = 0
    PASSIVE = 1
    SPRING = 2


ROLES = tuple(Role)


@dataclass(frozen=True)
class Names:
    """In the order of the core; springs and joints with the index of their (first) coordinate."""

    actuators: tuple[str, ...]
    cables: tuple[str, ...]
    """Those of the actuators that are winches of cables."""
    legs: tuple[str, ...]
    points: tuple[str, ...]
    coordinates: tuple[str, ...]
    roles: tuple[Role, ...]
    """Of each coordinate."""
    prismatic: tuple[bool, ...]
    """Whether each coordinate is a length; else it is an angle."""
    free_spins: tuple[str, ...]
    springs: Mapping[str, int]
    joints: Mapping[str, int]

    def is_prismatic(self, coordinate: str) -> bool:
        """Whether a coordinate is a length."""
        return self.prismatic[self.coordinates.index(coordinate)]


def names_of(core: Mechanism) -> Names:
    """All names of a mechanism."""
    coordinates, roles = tuple(core.coordinates), tuple(map(ROLES.__getitem__, core.roles))
    return Names(
        actuators=tuple(n for n, _ in core.actuators),
        cables=tuple(core.cables),
        legs=tuple(core.legs),
        points=tuple(core.points),
        coordinates=coordinates,
        roles=roles,
        prismatic=tuple(core.prismatic),
        free_spins=tuple(
            n
            for n, held, r in zip(coordinates, core.locked, roles, strict=True)
            if held and r == Role.PASSIVE
        ),
        springs=dict(core.springs),
        joints={n: i for i, (n, r) in enumerate(zip(coordinates, roles, strict=True)) if r != Role.SPRING},
    )
