"""What a diagnosis means over a plane of the workspace: errors of the declared and of the corrected machine there."""

from __future__ import annotations

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.identification.diagnosis.report.result import Diagnosis
from stiffmap.solve.machine import Machine


def worst_pose(d: Diagnosis) -> tuple[Floats, Floats] | None:
    """Position (3,) m in the plane of the maps where the corrected machine deflects most, and the wrench (6,) N, N·m.

    None without a force or a workspace, or where no pose of the plane has an answer.
    """
    if d.declared.description.workspace is None:
        return None
    position, force, _, errors = plane_errors(d)
    size = np.linalg.norm(errors, axis=-1)
    if not force.any() or not np.isfinite(size).any():
        return None
    return position[np.unravel_index(int(np.nanargmax(size)), size.shape)], force


def plane_errors(d: Diagnosis) -> tuple[Floats, Floats, Floats, Floats]:
    """Positions (25, 25, 3) m in the middle plane of the workspace, the wrench (6,) N, N·m, and errors (25, 25, 3) m before and after.

    Of the forces used, along x, y or z, it is the one under which the machines differ most.
    """
    low, high = d.declared.workspace
    x, y, _ = np.linspace(low, high, 25).T
    position = np.stack(np.broadcast_arrays(*np.meshgrid(x, y), (low[2] + high[2]) / 2), axis=-1)
    size = float(np.abs(d.experiment.wrench[:, :3]).max())
    tried = [np.append(size * axis, np.zeros(3)) for axis in np.eye(3)] if size > 0 else [np.zeros(6)]
    found = [(position, w, _errors(d.declared, position, w), _errors(d.machine, position, w)) for w in tried]
    return max(found, key=lambda f: float(np.max(np.abs(np.nan_to_num(f[3] - f[2])))))


def _errors(machine: Machine, position: Floats, wrench: Floats) -> Floats:
    solution = machine.solve(position, wrench)
    return np.where(solution.ok[..., None], solution.displacement[..., :3], np.nan)
