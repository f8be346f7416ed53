"""What unit tensions do to the platform, from the declared geometry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats, trailing
from stiffmap.common.errors import StiffmapError
from stiffmap.common.rotations import as_rotations
from stiffmap.model.description import Body, Cable, MachineDescription, Offset, Pose
from stiffmap.model.description.machine import TASK
from stiffmap.solve.machine import Machine, takes_machine


@dataclass(frozen=True, eq=False)
class Hanging:
    """The platform of a machine without legs, seen from its tcp: n cables, its weight."""

    anchor: Floats
    """(n, 3) m, base axes."""
    guide: Floats
    """(n, 3)."""
    radius: Floats
    """(n,) m."""
    at: Floats
    """(n, 3) m, tcp axes."""
    most: Floats
    """(n,) N, largest tensions; infinite where none is declared."""
    mass: float
    com: Floats
    """(3,) m, tcp axes."""
    rows: tuple[int, ...]
    """Components of a wrench that no guide takes."""
    length: float
    """m, turns moments into forces: the mean arm of the cables, where they have any."""


def hanging(machine: Machine) -> Hanging:
    """StiffmapError for a machine with legs."""
    d = machine.description
    if d.legs:
        raise StiffmapError(f"{d.name}: expected a machine that hangs in its cables alone, got one with legs")
    found, bodies, tip = _walk(d)
    back = tip.inverse()
    at = np.array([(back @ Pose(p)).p for _, p in found])
    mass = sum(b.mass for b, _ in bodies)
    moment = sum((b.mass * (back @ Pose(c)).p for b, c in bodies), np.zeros(3))
    return Hanging(
        anchor=np.array([c.anchor for c, _ in found]),
        guide=np.array([c.guide for c, _ in found]),
        radius=np.array([c.radius for c, _ in found]),
        at=at,
        most=np.array([c.drive.force if c.drive and c.drive.force else np.inf for c, _ in found]),
        mass=mass,
        com=moment / mass if mass else np.zeros(3),
        rows=tuple(i for i, name in enumerate(TASK) if name in d.freedoms),
        length=float(np.sqrt(np.mean(np.sum(at**2, axis=1)))) or machine.compiled.length,
    )


def _walk(d: MachineDescription):  # type: ignore[no-untyped-def]
    """Cables and bodies with their points in the platform's first frame, and the tcp there."""
    frame, found, bodies = Pose(), [], []
    for e in d.platform:
        match e:
            case Offset():
                frame = frame @ e.nominal
            case Cable():
                found.append((e, (frame @ Pose(e.at)).translation))
            case Body():
                bodies.append((e, (frame @ Pose(e.com)).translation))
    return found, bodies, frame


def lines(h: Hanging, position: Floats, rotation: Floats) -> tuple[Floats, Floats, Floats]:
    """Unit vectors (..., n, 3) from the guides to the platform, straight lengths (..., n) m, arms (..., n, 3) m."""
    arm = np.einsum("...ij,nj->...ni", rotation, h.at)
    d = position[..., None, :] + arm - h.anchor
    height = (d * h.guide).sum(-1)
    across = d - height[..., None] * h.guide
    off = np.linalg.norm(across, axis=-1)
    plane = off - h.radius
    with np.errstate(invalid="ignore", divide="ignore"):
        straight = np.sqrt(plane**2 + height**2 - h.radius**2)
        square = plane**2 + height**2
        s = (plane * straight + h.radius * height) / square
        c = (height * straight - h.radius * plane) / square
        over = s[..., None] * across / off[..., None] + c[..., None] * h.guide
    eye = np.broadcast_to((h.radius == 0)[:, None], over.shape)
    direct = np.linalg.norm(d, axis=-1)
    unit = np.where(eye, d / direct[..., None], over)
    return unit, np.where(h.radius == 0, direct, straight), arm


@takes_machine
def structure_matrix(machine: Machine, position: ArrayLike, rotation: ArrayLike | None = None) -> Floats:
    """Wrench (..., 6, cables) on the platform at the tcp, base axes, per unit tension, declared geometry.

    position (..., 3) m; rotation (..., 3, 3), None: as at home. The transpose, with the opposite sign, gives the rates
    of the free lengths of cables that do not yield. StiffmapError for a machine with legs.
    """
    p, r = poses(machine, position, rotation)
    return matrix(*lines(hanging(machine), p, r))


def poses(machine: Machine, position: ArrayLike, rotation: ArrayLike | None) -> tuple[Floats, Floats]:
    """Arrays of poses, checked."""
    p = trailing(position, (3,), "position", "positions (m)")
    if rotation is None:
        return p, machine.description.home.r
    return p, as_rotations(trailing(rotation, (3, 3), "rotation", "rotation matrices"))


def matrix(unit: Floats, straight: Floats, arm: Floats) -> Floats:
    """(..., 6, n) of `lines`."""
    return np.swapaxes(np.concatenate([-unit, np.cross(arm, -unit)], axis=-1), -1, -2)


def weight(h: Hanging, rotation: Floats, gravity: Floats) -> Floats:
    """(..., 6) wrench of the platform's bodies at the tcp."""
    force = h.mass * gravity
    lever = np.einsum("...ij,j->...i", rotation, h.com)
    return np.concatenate([np.broadcast_to(force, lever.shape), np.cross(lever, force)], axis=-1)
