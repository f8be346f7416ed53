"""How the tool follows each drive of the rigid machine."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.poses.configuration import coordinates_of, poses_once
from stiffmap.experiment.poses.once import Once
from stiffmap.solve.closing import of_drives
from stiffmap.solve.kinematics import forward_kinematics
from stiffmap.solve.machine import Machine

STEP = 1e-6
"""m or rad of a drive to either side."""


def drive_jacobian(machine: Machine, plan: Experiment) -> Floats:
    """(n, 6, actuators) twist of the TCP per unit of each drive of the rigid machine, in the plan's branch.

    NaN in a column where the drive cannot move to both sides. Found out once for all machines of one geometry; not to be written to.
    """
    return _KNOWN.get(plan, machine, lambda: _found(machine, plan))


_KNOWN: Once[Floats] = Once()


def _found(machine: Machine, plan: Experiment) -> Floats:
    plan, back = poses_once(plan)
    start = coordinates_of(machine, plan)
    drives = of_drives(machine.compiled, start)
    columns = []
    for k in range(drives.shape[-1]):
        unit = STEP * np.eye(drives.shape[-1])[k]
        up, down = (forward_kinematics(machine, drives + s * unit, start=start) for s in (1, -1))
        between = up.rotation @ np.swapaxes(down.rotation, 1, 2)
        lost = ~np.asarray(np.isfinite(between).all(axis=(1, 2)))[:, None, None]
        turn = Rotation.from_matrix(np.where(lost, np.eye(3), between)).as_rotvec()
        turn = np.where(lost[:, 0], np.nan, turn)
        columns.append(np.hstack([up.position - down.position, turn]) / (2 * STEP))
    return np.stack(columns, axis=-1)[back]
