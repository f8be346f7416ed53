"""Masses of a machine, the efforts that they ask of the drives, and its natural frequencies (docs/theory.md D4-D7); what cables hold, since
they pull and never push: forces and motions within their largest tensions (theory B7)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from stiffmap.common.broadcasting import Floats, batch, rows, thread_count, trailing, whole_number
from stiffmap.common.errors import StiffmapError
from stiffmap.common.short import short_repr
from stiffmap.model.description import Body
from stiffmap.model.description.tree import all_elements, core_name
from stiffmap.model.link.transport import skew
from stiffmap.solve.closing import loaded_poses
from stiffmap.solve.compiled.machine import CompiledMachine
from stiffmap.solve.compiled.names import Role
from stiffmap.solve.labels import OverPoses
from stiffmap.solve.machine import Machine, takes_machine
from stiffmap.workspace.cables.structure import Hanging, hanging, lines, matrix, nearest, scaled, weight
from stiffmap.workspace.performance.motion.closing import DriveKinematics, declared, revolute_drives
from stiffmap.workspace.performance.motion.many_drives import drive_weights, followed, inverse_rows, sides


def movers(compiled: CompiledMachine, node: int) -> Iterator[tuple[int, int]]:
    """Frame and number of each coordinate that moves a frame, from that frame to the base."""
    while node > 0:
        parent, coordinate = compiled.nodes[node]
        if coordinate >= 0:
            yield node, coordinate
        node = parent


def total_mass(machine: Machine) -> float:
    """kg, all bodies that the machine file declares."""
    return float(sum(mass for *_, mass in machine.compiled.core.bodies))


def moving_mass(machine: Machine) -> float:
    """kg, bodies that drives or passive joints move."""
    compiled = machine.compiled
    roles = compiled.names.roles
    moving = (
        m for _, n, m in compiled.core.bodies if any(roles[c] != Role.SPRING for _, c in movers(compiled, n))
    )
    return float(sum(moving))


def inertias(machine: Machine) -> Floats:
    """(bodies, 3, 3) kg·m² about the centres of mass, in the bodies' axes and the core's order."""
    found = {core_name(n): e for n, e in all_elements(machine.description) if isinstance(e, Body)}
    bodies = [found[name].inertia for name, _, _ in machine.compiled.core.bodies]
    return np.array(bodies, dtype=float).reshape(-1, 3, 3)


def need_masses(machine: Machine, what: str) -> None:
    """StiffmapError that names the bodies without mass, or says that there are none."""
    bodies = machine.compiled.core.bodies
    if not bodies:
        raise StiffmapError(
            f"{machine.name}: {what} needs masses, and the machine file declares no body; "
            f"add 'body' elements to the legs {', '.join(machine.legs)} and the platform"
        )
    empty = ", ".join(name for name, _, mass in bodies if mass <= 0)
    if empty:
        raise StiffmapError(f"{machine.name}: {what} needs masses; these bodies have none: {empty}")


SLOW = 1e-4
"""Of a drive's declared speed: below, Coulomb friction falls with the rate to zero, so that a drive that hardly moves has no friction
of either sign."""


def motion_friction(machine: Machine, rates: Floats) -> Floats:
    """(..., drives) friction of the drives along a motion: as `friction_efforts`, but continuous through rest.

    Where a drive declares no speed, its own largest rate along the motion, and that of the fastest drive of its kind, stand in.
    """
    turn = revolute_drives(machine)
    own = np.abs(rates).reshape(-1, rates.shape[-1]).max(axis=0, initial=0.0)
    fastest = np.where(turn, own.max(where=turn, initial=0.0), own.max(where=~turn, initial=0.0))
    speed = declared(machine, "speed", 0.0)
    limit = SLOW * np.where(speed > 0.0, speed, fastest)
    return friction_efforts(machine, rates, np.clip(rates / np.where(limit > 0.0, limit, 1.0), -1.0, 1.0))


def friction_efforts(machine: Machine, rates: Floats, sense: Floats | None = None) -> Floats:
    """(..., drives) Coulomb and viscous friction of the drives against their rates (..., drives).

    `sense` (..., drives) is the share of Coulomb friction that acts, -1 to 1; None: the sign of the rate.
    """
    coulomb, viscous = (declared(machine, f"{word}_friction", 0.0) for word in ("coulomb", "viscous"))
    return np.asarray(coulomb * (np.sign(rates) if sense is None else sense) + viscous * rates)


def rigid_dynamics(
    machine: Machine, coordinates: Floats, twist: Floats, twist_rate: Floats, wrench: Floats, gravity: ArrayLike | None,
    threads: int | None = None, *, sharing: str = "least_norm",
) -> dict[str, Floats]:  # fmt: skip
    """The core's inverse dynamics at closed coordinates (n, coordinates) and tip motions (n, 6); see `drive_weights`."""
    rates = accelerations = np.zeros((0, len(machine.actuators)))
    if machine.compiled.core.redundancy and (np.any(twist) or np.any(twist_rate)):
        rates, accelerations = followed(machine, coordinates, twist, twist_rate, threads)
    out: dict[str, Floats] = machine.compiled.core.dynamics(
        list(inertias(machine)), np.ascontiguousarray(coordinates), np.ascontiguousarray(twist),
        np.ascontiguousarray(twist_rate), np.ascontiguousarray(wrench), machine.compiled.gravity(gravity),
        rates=rates, accelerations=accelerations, weights=drive_weights(machine, sharing),
        threads=thread_count(threads),
    )  # fmt: skip
    return out


def rest_efforts(
    machine: Machine, k: DriveKinematics, *, gravity: ArrayLike | None, velocity: ArrayLike | None, sharing: str = "least_norm"
) -> Floats:  # fmt: skip
    """(..., drives) efforts at rest against gravity and springs, or at a constant velocity with friction."""
    shape, g = k.status.shape, machine.compiled.gravity(gravity)
    if velocity is not None or g.any():
        need_masses(machine, "gravity" if velocity is None else "motion")
    flat = k.coordinates.reshape(-1, k.coordinates.shape[-1])
    twist = np.zeros((len(flat), 6))
    if velocity is not None:
        v = trailing(velocity, (3,), "velocity", "velocities (m/s)")
        if batch(shape, v.shape[:-1]) != shape:
            raise StiffmapError(f"velocity: expected one or one for each pose, got shape {v.shape}")
        twist[:, :3] = rows(v, shape, (3,))
    zero = np.zeros_like(twist)
    out = rigid_dynamics(machine, flat, twist, zero, zero, g, sharing=sharing)
    effort = out["effort"] + friction_efforts(machine, out["rate"])  # none at rest
    return effort.reshape(k.actuators.shape)


@short_repr
@dataclass(frozen=True, eq=False)
class NaturalFrequencies(OverPoses):
    """Undamped modes at poses (...), lowest first; NaN beyond the last one and where the pose failed."""

    frequency: Floats
    """(..., modes) Hz."""
    shape: Floats
    """(..., modes, coordinates) m, rad: change of all coordinates, of unit modal mass (1 kg·m²)."""
    coordinates: Floats
    """(..., coordinates) at the equilibrium about which the machine vibrates."""
    status: NDArray[np.uint8]
    flags: NDArray[np.uint32]

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> Floats:
        return np.asarray(self.frequency, dtype=dtype)


@takes_machine
def natural_frequencies(
    machine: Machine,
    position: ArrayLike,
    wrench: ArrayLike | None = None,
    *,
    rotation: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    modes: int = 6,
    threads: int | None = None,
) -> NaturalFrequencies:
    """Frequencies (Hz) and mode shapes at commanded poses (..., 3) m, drives held.

    Mass matrix over all elastic coordinates, passive joints following, against the exact tangent at
    the loaded equilibrium: `wrench` (..., 6) N, N·m dead at the TCP and `gravity` (3,) m/s² (None: what
    the machine file says) change the stiffness. Bodies are rigid, as the machine file declares
    them. A dead moment makes the tangent unsymmetric: complex frequencies are flutter, status UNSTABLE.
    Raises StiffmapError for bad input (a machine without masses), never for a pose.
    """
    need_masses(machine, "a natural frequency")
    whole_number(modes, "modes", 1)
    shape, p, r, w = loaded_poses(machine.compiled, position, wrench, rotation)
    undamped = np.zeros(len(machine.compiled.names.coordinates))
    out = machine.compiled.core.modes(
        list(inertias(machine)), undamped, undamped, p, r, w, machine.compiled.gravity(gravity), closed=None, point="tcp", count=modes,
        whole=True, threads=thread_count(threads),
    )  # fmt: skip
    w0 = 1 / np.sqrt(out["square"])
    found = {k: out[k].reshape(shape + out[k].shape[1:]) for k in ("coordinates", "status", "flags")}
    return NaturalFrequencies(
        frequency=(w0 / (2 * np.pi)).reshape(*shape, *w0.shape[1:]),
        shape=(w0[..., None] * out["shape"]).reshape(*shape, *out["shape"].shape[1:]),
        **found,
    )


Held = tuple[Floats, Floats, Floats]
"""Rows (..., f, c), limits (..., f), offsets (..., f): what is held is all v with |rows v + offsets| <= limits."""
PUSHES = np.vstack([np.eye(3), np.zeros((3, 3))])  # (6, 3) wrenches at the tcp of unit forces on it


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
    next to weight and springs. The tensions' wrenches fill a zonotope, whose facets are the rows."""
    if len(most) < len(h.rows):
        raise StiffmapError(
            f"{machine.name}: {len(most)} cables for {len(h.rows)} freedoms hold no force in every direction"
        )
    load = weight(h, k.position, k.rotation, machine.compiled.gravity(gravity))
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
