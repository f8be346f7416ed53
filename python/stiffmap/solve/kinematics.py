"""Kinematics by closure, springs at rest."""

from __future__ import annotations

from numpy.typing import ArrayLike

from stiffmap.solve.branches import Start
from stiffmap.solve.closing import Kinematics, close_actuators, close_poses
from stiffmap.solve.compiled import Status
from stiffmap.solve.machine import Machine, hint_metres, takes_machine

__all__ = ["Kinematics", "forward_kinematics", "inverse_kinematics"]


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
    """TCP pose at actuator coordinates (..., actuators) m or rad, by continuation from home or from `start`."""
    return close_actuators(machine.compiled, actuators, start, threads)
