"""What a URDF says that no machine is like: its numbers are read as m, rad and kg, and may be meant in other units."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from stiffmap.model.urdf.model import UrdfJoint, UrdfModel

FARTHEST, WIDEST = 100.0, 40.0
"""m: of a way from the first moving joint on, and of a body, beyond those of cranes."""
DENSEST, SMALLEST = 2000.0, 0.7
"""kg/m³ and m: as much of all that moves in a cube of the machine's length; known robots have a fiftieth of it."""
ROUND = 0.5
"""Degrees of which limits are multiples."""


def doubts(model: UrdfModel) -> Iterator[str]:
    """Lines that name file and place, what was found, and what would be plausible."""
    ways = {link: _moving(model.way(link)) for link in model.links}
    lengths = {link: sum(float(np.linalg.norm(j.origin.p)) for j in way[1:]) for link, way in ways.items()}
    far = max(lengths, key=lambda link: lengths[link])
    if lengths[far] > FARTHEST:
        joint = max(ways[far][1:], key=lambda j: float(np.linalg.norm(j.origin.p)))
        yield (
            f"{model.file}: joint {joint.name}: origin: the way to link '{far}' is {lengths[far]:.4g} m long; "
            f"expected metres, and it would be {lengths[far] / 1e3:.3g} m if the file is in millimetres"
        )
    bodies = {link: body for link, body in model.links.items() if body}
    for link, body in bodies.items():
        at, size = (
            float(np.linalg.norm(body.com)),
            math.sqrt(abs(float(np.trace(body.inertia))) / 2 / body.mass),
        )
        if at > WIDEST:
            yield f"{model.file}: link {link}: its centre of mass is {at:.4g} m off; expected metres, as if in millimetres"
            break
        if size > WIDEST and body.mass > 0.1:
            yield (
                f"{model.file}: link {link}: an inertia of {np.trace(body.inertia) / 2:.3g} kg m^2 with {body.mass:.3g} kg "
                f"is that of a body {size:.3g} m in radius; expected kg m^2, as if in kg mm^2"
            )
            break
    mass = sum(body.mass for link, body in bodies.items() if ways[link])
    length = lengths[far] + max((_stroke(way) for way in ways.values()), default=0.0)
    if mass > DENSEST * max(length, SMALLEST) ** 3:
        heavy = max((b for link, b in bodies.items() if ways[link]), key=lambda b: b.mass)
        yield (
            f"{model.file}: link {heavy.name}: mass: {heavy.mass:.6g} kg, {mass:.6g} kg in all that moves, in a machine of "
            f"{length:.3g} m; expected kilograms, and it would be {mass / 1e3:.3g} kg if the file is in grams"
        )
    if turning := [j for j in model.moving if _in_degrees(j)]:
        low, high = turning[0].limits or (0.0, 0.0)
        more = f", one of {len(turning)} such joints" if len(turning) > 1 else ""
        yield (
            f"{model.file}: joint {turning[0].name}: limits {low:g} to {high:g} rad{more}; expected radians, "
            f"{math.radians(low):.4g} to {math.radians(high):.4g} if the file is in degrees"
        )


def _moving(way: list[UrdfJoint]) -> list[UrdfJoint]:
    """A way from its first moving joint on."""
    return way[next((i for i, j in enumerate(way) if j.kind != "fixed"), len(way)) :]


def _stroke(way: list[UrdfJoint]) -> float:
    return sum(j.limits[1] - j.limits[0] for j in way if j.kind == "prismatic" and j.limits)


def _in_degrees(joint: UrdfJoint) -> bool:
    largest = max(map(abs, joint.limits or (0.0,)))
    whole = all(v % ROUND == 0 for v in joint.limits or ())
    return joint.kind == "revolute" and whole and 4 * math.pi < largest <= 720
