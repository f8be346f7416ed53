"""What unit tensions do to the platform, from the declared geometry, and the tensions that hold it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stiffmap.common.broadcasting import Floats, refused, wrench_array
from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import Body, Cable, ExternalSpring, Offset, Point, Pose
from stiffmap.model.description.machine import TASK
from stiffmap.model.description.pose import Vector
from stiffmap.solve.closing import commanded
from stiffmap.solve.machine import Machine, takes_machine


@dataclass(frozen=True, eq=False)
class Hanging:
    """The platform of a machine without legs, seen from its tcp: n cables, its weight."""

    anchor: Floats  # (n, 3) m, base axes
    guide: Floats  # (n, 3)
    radius: Floats  # (n,) m
    at: Floats  # (n, 3) m, tcp axes
    most: Floats  # (n,) N, largest tensions; infinite where none is declared
    mass: float
    com: Floats  # (3,) m, tcp axes
    rows: tuple[int, ...]  # components of a wrench that no guide takes
    length: float  # m, turns moments into forces: the mean arm of the cables, where they have any
    springs: tuple[tuple[ExternalSpring, Floats], ...] = ()  # and (3,) m, where each pulls, tcp axes


def hanging(machine: Machine) -> Hanging:
    """StiffmapError for a machine with legs."""
    d = machine.description
    if d.legs:
        raise StiffmapError(f"{d.name}: expected a machine that hangs in its cables alone, got one with legs")
    tip = Pose()
    found: list[tuple[Cable, Vector]] = []
    bodies: list[tuple[Body, Vector]] = []
    points: dict[str, Vector] = {}
    for e in d.platform:  # their points in the platform's first frame
        match e:
            case Offset():
                tip = tip @ e.nominal
            case Cable():
                found.append((e, (tip @ Pose(e.at)).translation))
            case Body():
                bodies.append((e, (tip @ Pose(e.com)).translation))
            case Point():
                points[f"platform.{e.name}"] = (tip @ Pose(e.offset)).translation
    points["tcp"] = tip.translation
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
        springs=tuple((s, (back @ Pose(points[s.point])).p) for s in d.external_springs if s.point in points),
    )


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
    p, r = commanded(machine.compiled, position, rotation)
    return matrix(*lines(hanging(machine), p, r))


def matrix(unit: Floats, straight: Floats, arm: Floats) -> Floats:
    """(..., 6, n) of `lines`."""
    return np.swapaxes(np.concatenate([-unit, np.cross(arm, -unit)], axis=-1), -1, -2)


def weight(h: Hanging, position: Floats, rotation: Floats, gravity: Floats) -> Floats:
    """(..., 6) wrench of the platform's bodies and of the springs outside at the tcp."""
    loads = [(np.einsum("...ij,j->...i", rotation, h.com), h.mass * gravity)]
    for spring, at in h.springs:
        arm = np.einsum("...ij,j->...i", rotation, at)
        line = np.asarray(spring.anchor) - position - arm
        straight = np.linalg.norm(line, axis=-1, keepdims=True)
        stretch = np.maximum(straight - spring.length, 0.0 if spring.tension_only else -np.inf)
        loads.append((arm, spring.stiffness * stretch * line / straight))
    return sum((np.concatenate([f + 0.0 * arm, np.cross(arm, f)], axis=-1) for arm, f in loads), np.zeros(6))


MOST_STEPS = 100
BALANCED = 1e-9  # residual that is none, of the largest force


@dataclass(frozen=True, eq=False)
class TensionDistribution:
    """Tensions at poses, and whether there are any."""

    tension: Floats
    """(..., cables) N; NaN where no tensions within the limits balance the wrench."""
    feasible: NDArray[np.bool_]
    """(...)."""
    cables: tuple[str, ...]


@takes_machine
def tension_distribution(
    machine: Machine,
    position: ArrayLike,
    wrench: ArrayLike | None = None,
    *,
    rotation: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    lowest: ArrayLike = 0.0,
    highest: ArrayLike | None = None,
    near: ArrayLike | None = None,
) -> TensionDistribution:
    """Tensions that hold the platform at commanded poses against its weight, external springs and a wrench at the tcp.

    position (..., 3) m, wrench (..., 6) N and N·m, rotation (..., 3, 3); gravity (3,) m/s², None: the machine file's.
    Of all tensions between `lowest` and `highest` (N, one or one per cable; None: what the machine file allows) those
    nearest to `near` (N) in the sum of squares, None: the lowest ones. Machines without legs; StiffmapError otherwise.
    What lengths are commanded instead, `Machine.solve` says which tensions follow from compliance.
    """
    h = hanging(machine)
    p, r = commanded(machine.compiled, position, rotation)
    low, high = limits(h, lowest, highest)
    aim = low if near is None else _per_cable(h, near, "near")
    w = wrench_array(wrench) + weight(h, p, r, machine.compiled.gravity(gravity))
    a = matrix(*lines(h, p, r))
    shape = np.broadcast_shapes(a.shape[:-2], w.shape[:-1])
    a, b = scaled(h, np.broadcast_to(a, (*shape, *a.shape[-2:])), -np.broadcast_to(w, (*shape, 6)))
    t, ok, _ = nearest(a.reshape(-1, *a.shape[-2:]), b.reshape(-1, b.shape[-1]), low, high, aim)
    t = np.where(ok[:, None], t, np.nan)
    names = machine.compiled.names.cables
    return TensionDistribution(t.reshape(*shape, len(names)), ok.reshape(shape), names)


def limits(h: Hanging, lowest: ArrayLike, highest: ArrayLike | None) -> tuple[Floats, Floats]:
    """(n,) N each; StiffmapError where the lower is not below the upper."""
    low = _per_cable(h, lowest, "lowest")
    high = h.most if highest is None else _per_cable(h, highest, "highest")
    if not (low < high).all() or (low < 0).any():
        raise refused("lowest, highest", "0 <= lowest < highest in N", f"{low.tolist()} and {high.tolist()}")
    return low, high


def _per_cable(h: Hanging, values: ArrayLike, name: str) -> Floats:
    given = np.asarray(values, dtype=float)
    if given.shape not in ((), h.most.shape) or np.isnan(given).any():
        raise StiffmapError(f"{name}: expected one number of N or {h.most.size}, got {values!r}")
    return np.broadcast_to(given, h.most.shape).astype(float)


def scaled(h: Hanging, a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Rows that no guide takes, moments as forces."""
    size = np.where(np.arange(6) < 3, 1.0, 1.0 / h.length)
    rows = list(h.rows)
    return (a * size[:, None])[..., rows, :], (b * size)[..., rows]


def nearest(
    a: Floats, b: Floats, low: Floats, high: Floats, aim: Floats
) -> tuple[Floats, NDArray[np.bool_], Floats]:
    """Of (m, rows, n) a t = b, low <= t <= high the t nearest to `aim`; whether there is one; the multipliers.

    Newton on the concave dual with t(v) = clip(aim + a' v): piecewise quadratic, each step rises; where nothing is
    feasible it rises for ever along a direction that proves so.
    """
    m, rows, n = a.shape
    v = np.zeros((m, rows))
    size = np.maximum(np.abs(b).max(axis=1, initial=0.0), 1e-6 * np.abs(low).max() + 1e-9)
    done = np.zeros(m, dtype=bool)
    t = np.broadcast_to(np.clip(aim, low, high), (m, n)).copy()

    def dual(v: Floats, of: NDArray[np.intp]) -> tuple[Floats, Floats]:
        t = np.clip(aim + np.einsum("mrn,mr->mn", a[of], v), low, high)
        gap = b[of] - np.einsum("mrn,mn->mr", a[of], t)
        return 0.5 * ((t - aim) ** 2).sum(1) + (v * gap).sum(1), t

    for _ in range(MOST_STEPS):
        todo = np.flatnonzero(~done)
        if todo.size == 0:
            break
        value, t[todo] = dual(v[todo], todo)
        gap = b[todo] - np.einsum("mrn,mn->mr", a[todo], t[todo])
        z = aim + np.einsum("mrn,mr->mn", a[todo], v[todo])
        free = ((z > low) & (z < high)).astype(float)
        done[todo] = np.abs(gap).max(axis=1) < BALANCED * size[todo]
        k = np.einsum("mrn,mn,msn->mrs", a[todo], free, a[todo])
        k += 1e-10 * np.eye(rows)
        step = np.linalg.solve(k, gap[..., None])[..., 0]
        share = np.ones(todo.size)
        for _ in range(60):
            ahead, _t = dual(v[todo] + share[:, None] * step, todo)
            short = ahead < value + 1e-4 * share * (step * gap).sum(1) - 1e-14 * np.abs(value)
            if not short.any():
                break
            share = np.where(short, 0.5 * share, share)
        v[todo] += np.where(done[todo], 0.0, share)[:, None] * step
    return t, done, v
