"""Motions that cannot be: refused with place and time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.solve.machine import Machine
from stiffmap.solve.status import Status
from stiffmap.workspace.performance.motion.closing import DriveKinematics, drive_kinematics
from stiffmap.workspace.performance.motion.sharing import FLAT, motions

STEPS = 24
"""Halvings between two samples, to say where and when."""


def refuse_failed(machine: Machine, k: DriveKinematics, time: Floats | None, position: Floats) -> None:
    """StiffmapError with place and time of the first pose of a motion that cannot be; between two samples it is
    sought by halving."""
    failed = (k.status != Status.CONVERGED) | _crossed(machine, k)
    if not failed.any():
        return
    i = int(np.argmax(failed))
    share, p, status = 0.0, position[i], Status(int(k.status[i]))
    if i > 0:
        share, p = _between(machine, k, position, i)
    word = {Status.UNREACHABLE: "leaves the reach", Status.SINGULAR: "meets a singularity"}
    what = word.get(status, "passes a singularity")
    when = "" if time is None else f", t = {time[i] - share * (time[i] - time[max(i - 1, 0)]):.4g} s"
    raise StiffmapError(f"{machine.name}: the trajectory {what} at {place_text(p)}{when}")


def _between(machine: Machine, k: DriveKinematics, position: Floats, i: int) -> tuple[float, Floats]:
    """Share of the step back from sample `i`, and the place, of what happens between `i - 1` and `i`."""
    a, b = position[i - 1], position[i]
    low, high, start = 0.0, 1.0, k.coordinates[i - 1]
    for _ in range(STEPS):
        middle = (low + high) / 2
        there = drive_kinematics(machine, a + middle * (b - a), k.rotation[i - 1], start=start)
        if there.status != Status.CONVERGED or _crossed_between(machine, k, i - 1, there):
            high = middle
        else:
            low, start = middle, there.coordinates
    return 1 - high, a + high * (b - a)


def _crossed(machine: Machine, k: DriveKinematics) -> NDArray[np.bool_]:
    """(n,) where the drive Jacobian loses rank, or changes its orientation since the pose before; False where it is
    NaN."""
    return _lost(k.jacobian, k.together, machine.compiled.redundancy)


def _crossed_between(machine: Machine, k: DriveKinematics, i: int, there: DriveKinematics) -> bool:
    """The same between pose `i` and another one."""
    pair, together = (
        np.stack([getattr(k, name)[i], getattr(there, name)]) for name in ("jacobian", "together")
    )
    return bool(_lost(pair, together, machine.compiled.redundancy)[1])


def _lost(jacobian: Floats, together: NDArray[np.int32], redundancy: int) -> NDArray[np.bool_]:
    ok = np.isfinite(jacobian).all(axis=(1, 2))
    out = np.zeros(len(jacobian), dtype=bool)
    if not ok.any():
        return out
    j = jacobian[ok]
    if redundancy or (together[ok] < j.shape[-1]).any():
        values = np.asarray(np.linalg.svd(j, compute_uv=False), dtype=float)
        last = motions(together[ok], values, redundancy) - 1
        least = np.take_along_axis(values, np.maximum(last, 0)[:, None], axis=-1)[:, 0]
        out[ok] = least < FLAT * values[:, 0]
        return out
    # a smooth change of sign is a drive that stops moving the tool; a jump is one that runs away
    turn = np.linalg.det(np.swapaxes(j[:-1], 1, 2) @ j[1:])
    flipped = np.concatenate([[False], turn <= 0])
    scale = np.linalg.norm(j, axis=(-2, -1)) ** (2 * j.shape[-1])
    gram = np.linalg.det(np.swapaxes(j, 1, 2) @ j)
    out[ok] = flipped | (gram < 1e-18 * scale)
    return out


def place_text(p: Floats) -> str:
    """``(1.0, 2.0, 3.0) mm``."""
    return "({:.1f}, {:.1f}, {:.1f}) mm".format(*(1e3 * p))
