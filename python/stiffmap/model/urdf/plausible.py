"""What a URDF says that no machine is like: its numbers are read as m, rad and kg, and may be meant in other units."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from stiffmap.model.urdf.model import UrdfJoint, UrdfModel

FARTHEST = 100.0
"""m: of a way from the first moving joint on, beyond those of cranes."""
DENSEST, SMALLEST = 2000.0, 0.7
"""kg/m³ and m: as much of all that moves in a cube of the machine's length; known robots have a fiftieth of it."""
WIDEST = 50.0
"""Of the machine's length: a radius of gyration beyond it; in kg mm² it is a thousandfold, in g mm² the 31 623-fold."""
ROUNDED = 0.01
"""Of the largest principal moment, which is no larger than the other two together: by as much numbers that were rounded are off."""
LIMITS = 4 * math.pi, 720.0, 0.5
"""Of a joint in degrees: more than as many rad, at most as much, and a multiple."""


def doubts(model: UrdfModel) -> Iterator[str]:
    """Lines that name the place, what was found, and what would be plausible."""
    ways = {link: _moving(model.way(link)) for link in model.links}
    lengths = {link: sum(float(np.linalg.norm(j.origin.p)) for j in way[1:]) for link, way in ways.items()}
    bodies = [(link, body) for link, body in model.links.items() if body and ways[link]]
    off = {f"link {link}: inertial": float(np.linalg.norm(body.com)) for link, body in bodies}
    far = max(lengths, key=lambda link: lengths[link])
    for place, length in [(f"joint {j.name}: origin", lengths[far]) for j in ways[far][-1:]] + [*off.items()]:
        if length > FARTHEST:
            yield f"{place}: found it {length:.4g} m off; expected metres, {length / 1e3:.3g} m if these are millimetres"
            break
    mass = sum(body.mass for _, body in bodies)
    size = lengths[far] + max(
        sum(j.limits[1] - j.limits[0] for j in way if j.kind == "prismatic" and j.limits)
        for way in ways.values()
    )
    if mass > DENSEST * max(size, SMALLEST) ** 3:
        link, heavy = max(bodies, key=lambda one: one[1].mass)
        yield (
            f"link {link}: mass: found {heavy.mass:.6g} kg, and {mass:.6g} kg in all that moves, in a machine of {size:.3g} m; "
            f"expected kilograms, {heavy.mass / 1e3:.3g} kg if these are grams"
        )
    radii = {link: math.sqrt(np.abs(body.inertia).max() / body.mass) for link, body in bodies}
    link, radius = max(radii.items(), key=lambda one: one[1], default=("", 0.0))
    if radius > WIDEST * max(size, SMALLEST):
        yield (
            f"link {link}: inertia: found a radius of gyration of {radius:.4g} m in a machine of {size:.3g} m; expected kg m^2, "
            f"{radius / 1e3:.3g} m if these are kg mm^2, {radius / math.sqrt(1e9):.3g} m if g mm^2"
        )
    for link, body in bodies:
        a, b, c = np.linalg.eigvalsh(np.array(body.inertia))
        if (1 - ROUNDED) * c > a + b > 0:
            yield (
                f"link {link}: inertia: found principal moments of {a:.3g}, {b:.3g} and {c:.3g} kg m^2, which no body has; expected the "
                f"largest to be at most the sum of the others, {a + b:.3g}; those of other links may be wrong as well"
            )
            break
    for joint in model.moving:
        low, high = joint.limits or (0.0, 0.0)
        whole = low % LIMITS[2] == high % LIMITS[2] == 0
        if joint.kind == "revolute" and whole and LIMITS[0] < max(-low, high) <= LIMITS[1]:
            yield (
                f"joint {joint.name}: limit: found {low:g} to {high:g} rad; expected radians, {math.radians(low):.4g} to "
                f"{math.radians(high):.4g} if these are degrees, as may be those of other joints"
            )
            break


def _moving(way: list[UrdfJoint]) -> list[UrdfJoint]:
    """A way from its first moving joint on."""
    return way[next((i for i, j in enumerate(way) if j.kind != "fixed"), len(way)) :]
