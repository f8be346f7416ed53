"""The free turn of an arm about its tool, chosen along the path by dynamic programming (theory.md, M11)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import place_text
from stiffmap.common.tasks import workers
from stiffmap.machining.milling.equilibrium import wall_errors
from stiffmap.machining.milling.limits import fastest as fastest_drives
from stiffmap.machining.milling.setting import Setting, orientations
from stiffmap.solve.kinematics import inverse_kinematics

FASTEST = 3.0
"""rad/s of the turn about the tool."""
IDLE = "no turn changes the error, as the last joint turns about the tool's own axis; a spindle across the flange would make use of it"
SAME = 1e-6
"""Share by which errors differ that count as one: of such turns the one nearest to home is taken."""
ON_ANOTHER_BRANCH = 1.0
"""rad of a drive between neighbouring points: another configuration, not a motion."""


@dataclass(frozen=True, eq=False)
class Redundancy:
    """Turns of the tool for m points."""

    angle: Floats
    """(m,) rad."""
    error: Floats
    """(m,) m across the wall at these turns, before compensation."""
    fixed: Floats
    """(turns,) m: largest error with one turn all along; infinite where it does not hold the path."""
    turns: Floats
    """(turns,) rad of the grid."""

    @property
    def idle(self) -> bool:
        """Whether no turn about the tool changes the error: the last joint turns about the tool's own axis."""
        return bool(np.ptp(self.fixed) <= SAME * self.fixed.max()) if np.isfinite(self.fixed).all() else False


def redundancy(
    job: Setting,
    turns: int = 72,
    *,
    fastest: float | None = FASTEST,
    scheduler: object = None,
) -> Redundancy:
    """Turns (m,) rad that make the largest error smallest, and of these the smallest sum of squares.

    turns: number of the grid over a full turn. fastest: rad/s of the turn, None: no limit of its own. Reach, joint
    limits and the drives' speeds hold between neighbouring points. scheduler: address of a dask scheduler, or a
    `distributed.Client`, whose workers take the turns, with the same answer. Raises StiffmapError where no sequence holds the path.
    """
    if len(job.machine.actuators) < 6:
        raise StiffmapError(
            f"redundancy: {job.machine.name} has no free turn about its tool (it needs six drives)"
        )
    if turns < 2:
        raise StiffmapError(f"turns: expected 2 or more, got {turns}")
    grid = -np.pi + 2 * np.pi * np.arange(turns) / turns
    with workers(_turned, job, scheduler=scheduler) as hands:
        errors, drives = zip(*hands.in_order(float(angle) for angle in grid), strict=True)
    error, joints = np.stack(errors, axis=1), np.stack(drives, axis=1)
    time = np.linalg.norm(np.diff(job.position, axis=0), axis=1) / job.feed[1:]
    free = Steps(joints, time, fastest_drives(job.machine), grid, fastest)
    stage = np.abs(error)
    # first the least largest error, then the least sum of squares among the sequences that keep it
    top = best_sequence(stage, free, largest=True)
    if top is None:
        lost = int(np.argmax(~np.isfinite(stage).any(axis=1)))
        where = place_text(job.position[lost], ".1f")
        raise StiffmapError(
            f"redundancy: no turn of the tool holds the path on {job.machine.name}, as at {where}"
        )
    bound = max(stage[k, a] for k, a in enumerate(top))
    cost = stage**2 * (1 + SAME * np.abs(grid))
    chosen = best_sequence(np.where(stage <= bound * (1 + SAME), cost, np.inf), free, largest=False)
    assert chosen is not None
    rows = np.arange(len(job))
    return Redundancy(grid[chosen], error[rows, chosen], stage.max(axis=0), grid)


def _turned(job: Setting, angle: float) -> tuple[Floats, Floats]:
    """(m,) m and (m, actuators) of one turn all along, as a task."""
    turned = replace(job, rotation=orientations(job.machine, job.tool, np.full(len(job), angle)))
    drives = inverse_kinematics(job.machine, job.position, turned.rotation, threads=job.threads).actuators
    return wall_errors(turned), drives


@dataclass(frozen=True, eq=False)
class Steps:
    """Which turn may follow which."""

    joints: Floats
    time: Floats
    """(m - 1,) s."""
    most: Floats
    grid: Floats
    fastest: float | None

    def allowed(self, k: int) -> NDArray[np.bool_]:
        """(turns, turns) bool from those of point k to those of the next."""
        move = np.abs(self.joints[k + 1][None] - self.joints[k][:, None])
        if self.time[k] <= 0:  # both ends of a joint: the arm stands still
            return np.eye(len(self.grid), dtype=bool)
        ok = (move <= np.minimum(self.most * self.time[k] + 1e-9, ON_ANOTHER_BRANCH)).all(axis=2)
        if self.fastest is not None:
            turn = np.abs(self.grid[None] - self.grid[:, None])
            turn = np.minimum(turn, 2 * np.pi - turn)
            ok = ok & (turn <= self.fastest * self.time[k] + 1e-9)
        return np.asarray(ok)


def best_sequence(stage: Floats, free: Steps, *, largest: bool) -> list[int] | None:
    """Turns, one for each point, with the least largest or the least sum of stage (m, turns); None where there are none."""
    m = len(stage)
    cost = stage[0].copy()
    came = np.zeros((m, stage.shape[1]), dtype=int)
    for k in range(m - 1):
        through = np.where(free.allowed(k), cost[:, None], np.inf)
        came[k + 1] = np.argmin(through, axis=0)
        before = through.min(axis=0)
        cost = np.maximum(before, stage[k + 1]) if largest else before + stage[k + 1]
    if not np.isfinite(cost).any():
        return None
    out = [int(np.argmin(cost))]
    for k in range(m - 1, 0, -1):
        out.append(int(came[k, out[-1]]))
    return out[::-1]
