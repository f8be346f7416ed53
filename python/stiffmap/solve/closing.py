"""Closure of compiled machines, springs at rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from stiffmap.common.broadcasting import Floats, batch, rows, thread_count, trailing, wrench_array
from stiffmap.common.errors import StiffmapError
from stiffmap.common.rotations import as_rotations
from stiffmap.common.short import short_repr
from stiffmap.solve.compiled import CompiledMachine
from stiffmap.solve.labels import OverPoses

Start = ArrayLike | Mapping[str, ArrayLike]
"""Coordinates (..., coordinates) as `Solution.coordinates` has them, or joint name -> (...) m or rad."""


@short_repr
@dataclass(frozen=True, eq=False)
class Kinematics(OverPoses):
    """Configurations of a batch of poses; NaN where the status is UNREACHABLE."""

    actuators: Floats
    """(..., actuators) m or rad, in the order of `Machine.actuators`."""
    position: Floats
    """(..., 3) m, TCP."""
    rotation: Floats
    """(..., 3, 3)."""
    status: NDArray[np.uint8]
    flags: NDArray[np.uint32]
    coordinates: Floats
    """(..., coordinates) all coordinates, springs at zero."""

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> Floats:
        return np.asarray(self.actuators, dtype=dtype)


def commanded(
    machine: CompiledMachine, position: ArrayLike, rotation: ArrayLike | None
) -> tuple[Floats, Floats]:
    """Positions (..., 3) m and rotations (..., 3, 3) of commanded poses, checked; None: as at home."""
    p = trailing(position, (3,), "position", "positions (m)")
    if rotation is None:
        return p, machine.home_rotation
    return p, as_rotations(trailing(rotation, (3, 3), "rotation", "rotation matrices"))


def loaded_poses(
    machine: CompiledMachine, position: ArrayLike, wrench: ArrayLike | None, rotation: ArrayLike | None
) -> tuple[tuple[int, ...], Floats, Floats, Floats]:
    """Batch axes of commanded poses under a wrench each, and positions (n, 3) m, rotations (n, 3, 3), wrenches (n, 6) N, N·m of all of
    them; None: as at home, no wrench. StiffmapError for bad input."""
    p, r = commanded(machine, position, rotation)
    w = wrench_array(wrench)
    shape = batch(p.shape[:-1], w.shape[:-1], r.shape[:-2])
    return shape, rows(p, shape, (3,)), rows(r, shape, (3, 3)), rows(w, shape, (6,))


def close_poses(
    machine: CompiledMachine,
    position: ArrayLike,
    rotation: ArrayLike | None,
    start: Start | None,
    threads: int | None,
) -> Kinematics:
    """See `stiffmap.inverse_kinematics`."""
    p, r = commanded(machine, position, rotation)
    shape, from_x = _started(machine, start, p.shape[:-1], r.shape[:-2])
    out = machine.close_poses(rows(p, shape, (3,)), rows(r, shape, (3, 3)), thread_count(threads), from_x)
    return _kinematics(machine, out, shape)


def close_actuators(
    machine: CompiledMachine, actuators: ArrayLike, start: Start | None, threads: int | None
) -> Kinematics:
    """See `stiffmap.forward_kinematics`."""
    n = len(machine.names.actuators)
    a = trailing(actuators, (n,), "actuators", f"{n} actuator coordinates")
    shape, from_x = _started(machine, start, a.shape[:-1])
    of_joints = rows(a, shape, (n,)) @ np.linalg.inv(machine.coupling).T
    out = machine.close_actuators(of_joints, thread_count(threads), from_x)
    return _kinematics(machine, out, shape)


def of_drives(machine: CompiledMachine, coordinates: Floats) -> Floats:
    """(..., actuators) what the controller shows of all joint coordinates (..., coordinates)."""
    index = [machine.names.joints[a] for a in machine.names.actuators]
    return np.asarray(coordinates[..., index] @ machine.coupling.T)


def start_coordinates(machine: CompiledMachine, start: Start) -> Floats:
    """(..., coordinates): joints that a mapping leaves out are as at home; StiffmapError for an unknown joint."""
    names = machine.names
    n = len(names.coordinates)
    if not isinstance(start, Mapping):
        return trailing(start, (n,), "start", f"{n} coordinates or joint name -> value")
    values = {}
    for name, value in start.items():
        if name not in names.joints:
            raise StiffmapError(f"start: expected joints among {', '.join(names.joints)}, got {name!r}")
        values[name] = trailing(value, (), f"start[{name!r}]", "numbers (m or rad)")
    shape = np.broadcast_shapes(*(v.shape for v in values.values()))
    out = np.tile(machine.home_coordinates(), (*shape, 1))
    for name, v in values.items():
        out[..., names.joints[name]] = v
    return out


def _started(
    machine: CompiledMachine, start: Start | None, *shapes: tuple[int, ...]
) -> tuple[tuple[int, ...], Floats | None]:
    """The batch shape of all that is given, and the rows (n, coordinates) to start from."""
    if start is None:
        return batch(*shapes), None
    x = start_coordinates(machine, start)
    shape = batch(*shapes, x.shape[:-1])
    return shape, rows(x, shape, x.shape[-1:])


def _kinematics(machine: CompiledMachine, out: tuple[Any, ...], shape: tuple[int, ...]) -> Kinematics:
    x, p, r, status, flags = out
    shown = of_drives(machine, x)
    return Kinematics(
        actuators=shown.reshape((*shape, shown.shape[-1])),
        position=p.reshape((*shape, 3)),
        rotation=r.reshape((*shape, 3, 3)),
        status=status.reshape(shape),
        flags=flags.reshape(shape),
        coordinates=x.reshape((*shape, x.shape[1])),
    )
