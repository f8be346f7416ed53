"""What cables hold, since they pull and never push: forces and motions within their largest tensions (theory B7)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.model.link.transport import skew
from stiffmap.solve.machine import Machine
from stiffmap.workspace.cables.structure import Hanging, hanging, lines, matrix, nearest, scaled, weight
from stiffmap.workspace.performance.motion.closing import DriveKinematics
from stiffmap.workspace.performance.motion.sharing import drive_weights, sides
from stiffmap.workspace.performance.motion.zonotopes import inverse_rows

Held = tuple[Floats, Floats, Floats]
"""Rows (..., f, c), limits (..., f), offsets (..., f): what is held is all v with |rows v + offsets| <= limits."""
PUSHES = np.vstack([np.eye(3), np.zeros((3, 3))])
"""(6, 3) wrenches at the tcp of unit forces on it."""


def in_cables(machine: Machine, what: str) -> Hanging | None:
    """The platform of a machine in cables alone; None where there are no cables.

    StiffmapError for a machine with both cables and legs, of which `what` is not known.
    """
    if not machine.compiled.names.cables:
        return None
    if machine.description.legs:
        raise StiffmapError(
            f"{machine.name}: {what} is not known of a machine with both cables and legs, only of one that hangs in cables alone"
        )
    return hanging(machine)


def held(
    machine: Machine, h: Hanging, k: DriveKinematics, columns: Floats, most: Floats, gravity: ArrayLike | None
) -> Held:
    """Coordinates v of a wrench, columns (..., 6, c) times v, that tensions from 0 to `most` (cables,) N hold at poses
    next to the weight. The tensions' wrenches fill a zonotope, whose facets are the rows."""
    if len(most) < len(h.rows):
        raise StiffmapError(
            f"{machine.name}: {len(most)} cables for {len(h.rows)} freedoms hold no force in every direction"
        )
    load = weight(h, k.rotation, machine.compiled.gravity(gravity))
    wanted, _ = scaled(h, columns, load)
    a, load = scaled(h, matrix(*lines(h, k.position, k.rotation)), load)
    normals, distance = sides(a * (most / 2), len(h.rows))
    offset = np.einsum("...fr,...r->...f", normals, load + (a * (most / 2)).sum(axis=-1))
    return normals @ wanted, distance, offset


def inertia_columns(h: Hanging, rotation: Floats) -> Floats:
    """(..., 6, 3) wrenches at the tcp that unit accelerations ask for, orientation kept."""
    turning = skew(np.einsum("...ij,j->...i", rotation, h.com))
    linear = np.broadcast_to(np.eye(3), turning.shape)
    return np.asarray(h.mass * np.concatenate([linear, turning], axis=-2))


def as_tensions(
    machine: Machine, h: Hanging, k: DriveKinematics, effort: Floats, most: Floats, sharing: str
) -> Floats:
    """(..., cables) efforts of winches, minus the tensions, that do to the platform what these efforts do; of all tensions
    from 0 to `most` those of the least sum of squares (`stiffness`: of squares over the cables' stiffness at home).
    NaN where there are none."""
    back = inverse_rows(k.jacobian)
    asked = np.einsum("...nr,...n->...r", back, effort)
    a, b = scaled(h, matrix(*lines(h, k.position, k.rotation)), asked)
    weights = drive_weights(machine, sharing)
    root = np.sqrt(weights) if weights.size else np.ones(len(most))
    shape = b.shape[:-1]
    bad = ~np.isfinite(b).all(axis=-1).reshape(-1)
    flat_a = np.nan_to_num((a * root).reshape(-1, *a.shape[-2:]))
    flat_b = np.nan_to_num(b.reshape(-1, b.shape[-1]))
    none = np.zeros(len(most))
    t, ok, _ = nearest(flat_a, flat_b, none, most / root, none)
    t = np.where((ok & ~bad)[:, None], t * root, np.nan)
    return np.asarray(-t.reshape(*shape, len(most)))
