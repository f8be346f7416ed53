"""Kinematics by closure, springs at rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import TASK
from stiffmap.solve.closing import Kinematics, Start, close_actuators, close_poses
from stiffmap.solve.compiled import Status
from stiffmap.solve.machine import Machine, hint_metres, takes_machine

__all__ = ["Kinematics", "forward_kinematics", "inverse_kinematics", "missed", "missed_words", "must_take"]

SAME = 1e-7
"""m, rad: poses that differ by less are one."""


@takes_machine
def inverse_kinematics(
    machine: Machine,
    position: ArrayLike,
    rotation: ArrayLike | None = None,
    *,
    start: Start | None = None,
    threads: int | None = None,
) -> Kinematics:
    """Actuator and passive coordinates at commanded TCP poses, on the declared assembly branch.

    position (..., 3) m; rotation (..., 3, 3), None: as at home. start: joint coordinates on another branch
    (docs/conventions.md), which are closed with their actuators held and continued to the pose; None: from
    home. docs/theory.md (C3), (C5).
    """
    out = close_poses(machine.compiled, position, rotation, start, threads)
    hint_metres(machine, position, bool((out.status == Status.UNREACHABLE).all()))
    return out


@takes_machine
def forward_kinematics(
    machine: Machine, actuators: ArrayLike, *, start: Start | None = None, threads: int | None = None
) -> Kinematics:
    """TCP pose at actuator coordinates (..., actuators) m or rad, by continuation from home or from `start`.

    It is where the declared geometry puts the TCP, which is what a controller knows. Effects on the geometry, such as those that
    `calibrate` writes into a machine file, do not enter: where the machine really stands is this pose moved by
    `machine.solve_joints(actuators).displacement` (no load; TCP translation m, rotation vector rad, base axes).
    """
    return close_actuators(machine.compiled, actuators, start, threads)


def missed(
    machine: Machine, position: Floats, rotation: Floats | None = None, threads: int | None = None
) -> Floats:
    """(..., 6) m, rad: the pose that the machine takes without load less the one that is asked for; rx, ry, rz about the tool's
    axes, 0 where no rotation (..., 3, 3) is asked for. A machine that does not command all of a pose reaches any by its status.
    """
    shape = np.broadcast_shapes(position.shape[:-1], () if rotation is None else rotation.shape[:-2])
    gap = np.zeros((*shape, 6))
    if set(TASK) - set(machine.description.task):
        at = inverse_kinematics(machine, position, rotation, threads=threads)
        gap[..., :3] = at.position - position
        if rotation is not None:
            turn = np.swapaxes(rotation, -1, -2) @ np.nan_to_num(at.rotation)
            turn[np.isnan(at.rotation).any(axis=(-1, -2))] = np.eye(3)
            gap[..., 3:] = Rotation.from_matrix(turn.reshape(-1, 3, 3)).as_rotvec().reshape(*shape, 3)
    return gap


def missed_words(machine: Machine, gap: Floats) -> str:
    """``y, z by up to 3 mm (swing-table commands x)``: the directions in which poses (..., 6) m, rad are missed; empty where none is."""
    most = np.nanmax(np.abs(gap.reshape(-1, 6)), axis=0, initial=0.0)
    found = [
        f"{axis} by up to {1e3 * v:.4g} mm" if len(axis) == 1 else f"{axis} by up to {np.degrees(v):.4g} deg"
        for axis, v in zip(TASK, most, strict=True)
        if v > SAME
    ]
    return f"{', '.join(found)} (it commands {', '.join(machine.description.task)})" if found else ""


def must_take(machine: Machine, position: Floats, rotation: Floats | None = None) -> None:
    """Raise StiffmapError where others than the wanted poses (n, 3) m, (n, 3, 3) are taken; a coordinate that is not commanded and as
    at home is not asked for."""
    home, task = machine.description.home, machine.description.task
    asked = np.zeros((len(position), 6))
    asked[:, :3] = position - home.p
    if rotation is not None:
        asked[:, 3:] = Rotation.from_matrix(home.r.T @ rotation).as_rotvec()
    still = np.array([axis not in task for axis in TASK]) & (np.abs(asked) <= SAME)
    gap = np.where(still, 0.0, missed(machine, position, rotation))
    words = missed_words(machine, gap)
    if words:
        first = int(np.argmax((np.abs(gap) > SAME).any(axis=1)))
        raise StiffmapError(
            f"{machine.name} cannot take the wanted poses: it misses {words}; the first is row {first + 1}"
        )
