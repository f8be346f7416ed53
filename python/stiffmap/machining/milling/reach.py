"""Paths that leave the workspace: which points, and where the part would fit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.machining.milling.setting import Setting
from stiffmap.solve.kinematics import SAME, missed, missed_words
from stiffmap.solve.status import Status


def reached(job: Setting, position: Floats, threads: int | None = None) -> NDArray[np.bool_]:
    """(...,) bool: poses (..., m, 3) that the machine takes without load."""
    s = job.machine.solve(position, rotation=job.rotation, stiffness=False, threads=threads)
    return np.asarray((s.status != Status.UNREACHABLE) & followed(job, position, threads))


def astray(job: Setting, position: Floats, threads: int | None = None) -> Floats:
    """(..., m, 6) m, rad by which the machine misses what the path asks for at positions (..., m, 3): of the three coordinates, the
    tool's axis, and the turn about it where the path sets one."""
    gap = missed(job.machine, position, job.rotation, threads)
    if job.angle is None:
        axis = np.einsum("mji,mj->mi", job.rotation, job.tool)
        gap[..., 3:] -= (gap[..., 3:] * axis).sum(axis=-1, keepdims=True) * axis
    return gap


def followed(job: Setting, position: Floats, threads: int | None = None) -> NDArray[np.bool_]:
    """(..., m) bool: positions (..., m, 3) m at which the machine does what the path asks for."""
    return np.asarray((np.abs(astray(job, position, threads)) <= SAME).all(axis=-1))


def must_follow(job: Setting, threads: int | None = None) -> None:
    """Raise StiffmapError with the directions in which the machine does not follow the path."""
    gap = astray(job, job.position, threads)
    words = missed_words(job.machine, gap)
    if words:
        i = int(np.argmax((np.abs(gap) > SAME).any(axis=-1)))
        raise StiffmapError(
            f"{job.machine.name} cannot follow the path: it misses {words}; from line {job.path.line[job.points.move[i]]} of the path on"
        )


def must_reach(job: Setting, threads: int | None = None) -> None:
    """Raise StiffmapError naming the points out of reach, how far the part sticks out, and a place that holds it."""
    must_follow(job, threads)
    ok = reached(job, job.position, threads)
    if ok.all():
        return
    lost = np.flatnonzero(~ok)
    lines = job.path.line[job.points.move[lost]]
    where = ", ".join(f"{v:.1f}" for v in 1e3 * job.position[lost[0]])
    text = (
        f"the path leaves the workspace of {job.machine.name}: {lost.size} of {len(job)} points, the first at ({where}) mm, "
        f"line {lines[0]} of the path"
    )
    box = job.machine.description.workspace
    if box is None:
        raise StiffmapError(text)
    low, high = np.array(box)
    out = np.maximum(np.maximum(low - job.position, job.position - high), 0.0).max(axis=0)
    text += f"; beyond the declared box by up to ({', '.join(f'{1e3 * v:.1f}' for v in out)}) mm"
    if (np.ptp(job.position, axis=0) > high - low).any():
        raise StiffmapError(f"{text}; the part is larger than that box")
    middle = (job.position.max(axis=0) + job.position.min(axis=0)) / 2
    shift = (low + high) / 2 - middle
    fits = reached(job, job.position + shift, threads).all()
    at = 1e3 * (job.place.at + shift)
    hint = f"; it fits with the part's origin at ({', '.join(f'{v:.1f}' for v in at)}) mm" if fits else ""
    raise StiffmapError(text + hint)
