"""Motions that cannot be: refused with place and time."""

from __future__ import annotations

import numpy as np

from stiffmap.broadcasting import Floats
from stiffmap.errors import StiffmapError
from stiffmap.machine import Machine
from stiffmap.performance.closing import DriveKinematics
from stiffmap.status import Status


def refuse_failed(machine: Machine, k: DriveKinematics, time: Floats | None, position: Floats) -> None:
    """StiffmapError with place and time of the first pose of a motion that cannot be."""
    failed = k.status != Status.CONVERGED
    if not failed.any() and len(failed) > 1:
        failed = _crossed(k)
    if not failed.any():
        return
    i = int(np.argmax(failed))
    word = {Status.UNREACHABLE: "leaves the reach", Status.SINGULAR: "meets a singularity"}
    what = word.get(Status(int(k.status[i])), "passes a singularity")
    when = "" if time is None else f", t = {time[i]:.4g} s"
    raise StiffmapError(f"{machine.name}: the trajectory {what} at {place_text(position[i])}{when}")


def _crossed(k: DriveKinematics) -> np.ndarray:
    """Where the drive Jacobian of a machine with as many drives as motions changes its orientation."""
    first = k.jacobian[0]
    u = np.linalg.svd(first, full_matrices=False)[0]
    det = np.linalg.det(u.T @ k.jacobian)
    flipped = np.zeros(len(det), dtype=bool)
    flipped[1:] = np.sign(det[1:]) * np.sign(det[:-1]) <= 0
    scale = np.linalg.norm(k.jacobian, axis=(-2, -1)) ** k.jacobian.shape[-1]
    # a smooth change of sign is a drive that stops moving the tool; a jump is one that runs away
    return np.asarray(flipped & (np.abs(det) < 0.1 * scale) | (np.abs(det) < 1e-9 * scale))


def place_text(p: Floats) -> str:
    """``(1.0, 2.0, 3.0) mm``."""
    return "({:.1f}, {:.1f}, {:.1f}) mm".format(*(1e3 * p))
