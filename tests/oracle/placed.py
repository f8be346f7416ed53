"""A description for the oracle: every joint at the coordinates of a closed pose, elastic joints at rest at the closed
home, and free ball joints by the axes that number their rotations in a solution (docs/theory.md C8)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.model.description import Block, Branch, Element, Joint, MachineDescription, Offset, Pose

WIDE = 0.9  # volume of a ball joint's axes at home, below which other axes number its rotations
Coordinates = dict[str, float]
Charts = Mapping[str, tuple[np.ndarray, np.ndarray]]


def placed(
    d: MachineDescription, home: Coordinates, at: Coordinates, pose: Pose, spun: Charts
) -> MachineDescription:
    """`home` and `at`: coordinates by full name where the machine is closed; `spun`: rotation at home and axes behind
    it of balls that have others than declared (any do: they are free, and what closes is a ball joint that closes)."""

    def walk(elements: tuple[Element, ...], prefix: str) -> tuple[Element, ...]:
        out: list[Element] = []
        for e in elements:
            if isinstance(e, Block):
                branches = (Branch(b.name, walk(b.elements, f"{prefix}{b.name}.")) for b in e.branches)
                out.append(replace(e, branches=tuple(branches)))
            elif isinstance(e, Joint):
                out += joint(e, prefix + e.name, home, at, spun)
            else:
                out.append(e)
        return tuple(out)

    legs = tuple(replace(leg, elements=walk(leg.elements, f"{leg.name}.")) for leg in d.legs)
    return replace(d, base=walk(d.base, ""), legs=legs, platform=walk(d.platform, ""), home=pose)


def as_drawn(d: MachineDescription) -> MachineDescription:
    """Without the errors of its offsets."""

    def walk(elements: tuple[Element, ...]) -> tuple[Element, ...]:
        out: list[Element] = []
        for e in elements:
            if isinstance(e, Block):
                out.append(replace(e, branches=tuple(Branch(b.name, walk(b.elements)) for b in e.branches)))
            else:
                out.append(replace(e, actual=None) if isinstance(e, Offset) else e)
        return tuple(out)

    legs = tuple(replace(leg, elements=walk(leg.elements)) for leg in d.legs)
    return replace(d, base=walk(d.base), legs=legs, platform=walk(d.platform))


def joint(e: Joint, name: str, home: Coordinates, at: Coordinates, spun: Charts) -> tuple[Element, ...]:
    names = [name] if len(e.axes) == 1 else [f"{name}.{i + 1}" for i in range(len(e.axes))]
    values = tuple(at[n] for n in names)
    if name in spun:
        turn, own = spun[name]
        turn = turn if spread(e) >= WIDE else turns(e)[-1] @ turn
        around = tuple((float(a[0]), float(a[1]), float(a[2])) for a in own)
        return (Offset(f"{e.name}_home", Pose.of((0, 0, 0), turn)), replace(e, axes=around, home=values))
    if e.kind != "spherical" or not e.free or spread(e) >= WIDE:
        rest = e.rest or (None if e.actuated or e.free else tuple(home[n] for n in names))
        return (replace(e, home=values, rest=rest),)
    turn = turns(e)[-1]
    axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    return (Offset(f"{e.name}_home", Pose.of((0, 0, 0), turn)), replace(e, axes=axes, home=values))


def turns(e: Joint) -> list[np.ndarray]:
    """Rotation before the first axis, behind the first, ..., behind the last at the declared home."""
    out = [np.eye(3)]
    for axis, angle in zip(e.axes, e.home, strict=True):
        out.append(out[-1] @ Rotation.from_rotvec(angle * np.array(axis)).as_matrix())
    return out


def spread(e: Joint) -> float:
    """Volume of the three axes at the declared home."""
    axes = [r @ np.array(a) for r, a in zip(turns(e), e.axes, strict=False)]
    return abs(float(np.linalg.det(np.array(axes))))
