"""Which poses are inside the workspace: each closed from a neighbour, and judged by every limit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from stiffmap.common.broadcasting import Floats
from stiffmap.model.description.machine import TASK
from stiffmap.solve.status import Status
from stiffmap.workspace.performance.limits.limits import Bounds
from stiffmap.workspace.performance.motion.closing import (
    DriveKinematics,
    drive_kinematics,
    kernel_starts,
    weighted,
)
from stiffmap.workspace.performance.motion.velocity import distances, transmission_of

NEIGHBOURS = 8  # of every pose: from those that close, it is tried next
TURN = 0.5  # m, rad: most that a coordinate may change on the way to a neighbour at the border
STEPS = (0.03, 0.1, 0.3, 0.6, 0.9)
SAME = 1e-2  # m, rad: coordinates that are the same; those of stretched legs are known by half their digits
REACH = "reach"
SINGULAR = "singularity"


@dataclass(frozen=True, eq=False)
class JudgedPoses:
    """Poses, and what was found of them."""

    position: Floats
    """(n, 3) m."""
    closed: NDArray[np.bool_]
    """(n,) within reach, on home's side of singularities where those count."""
    inside: NDArray[np.bool_]
    """(n,) also within every limit."""
    coordinates: Floats
    """(n, coordinates) NaN where not closed."""
    broken: dict[str, NDArray[np.bool_]]
    """(n,) by limit: who breaks it."""

    def mark(self, name: str, rows: NDArray[np.int64], bad: NDArray[np.bool_]) -> None:
        """These of the rows break a limit, or its other end."""
        self.broken.setdefault(name, np.zeros(len(self.position), dtype=bool))[rows] |= bad

    def causes(self) -> dict[str, NDArray[np.bool_]]:
        """(n,) by limit, reach among them, for poses that are not inside."""
        known = np.zeros(len(self.position), dtype=bool)
        for bad in self.broken.values():
            known |= bad
        return {**self.broken, REACH: ~self.inside & ~known}


@dataclass(frozen=True, eq=False)
class Inside:
    """Whether poses are inside the workspace, and what excludes those that are not."""

    bounds: Bounds
    singularity: float | None

    def __call__(self, position: Floats, known: JudgedPoses | None = None) -> JudgedPoses:
        """Judges poses (n, 3): each begins at a neighbour that closed, the first ones at the middle of the workspace;
        or all of them at the nearest one of poses that are known."""
        n, size = len(position), len(self.bounds.machine.compiled.names.coordinates)
        closed, inside = np.zeros((2, n), dtype=bool)
        out = JudgedPoses(position, closed, inside, np.full((n, size), np.nan), {})
        if known is not None:
            if known.closed.any():
                nearest = cKDTree(known.position[known.closed]).query(position)[1]
                start = known.coordinates[known.closed][nearest]
                self._judge(out, np.arange(len(position)), self._from(position, start))
            return out
        if not len(position):
            return out
        near = cKDTree(position).query(position, min(NEIGHBOURS, len(position)))[1].reshape(len(position), -1)
        away = np.linalg.norm(position - self.bounds.machine.workspace.mean(axis=0), axis=1)
        rows = np.argsort(away, kind="stable")[:NEIGHBOURS]
        self._judge(out, rows, self.bounds.closed(position[rows]))
        tried = np.zeros(len(position), dtype=bool)
        new = out.closed.copy()
        while new.any():
            lit = new[near]
            rows = np.flatnonzero(~out.closed & lit.any(axis=1))
            before = out.closed.copy()
            at = near[rows, lit[rows].argmax(axis=1)]
            k = self._from(position[rows], out.coordinates[at])
            self._judge(out, rows, k, self._sound(out, at, k))
            new = out.closed & ~before
            if new.any():
                continue
            # stretched legs at the border are a long way for Newton's method: those once more, slowly
            rows = np.flatnonzero(~out.closed & ~tried & out.closed[near].any(axis=1))
            tried[rows] = True
            k = self._slowly(position[rows])
            self._judge(out, rows, k, self._sound(out, self._nearest(out, near, rows), k))
            new = out.closed & ~before
        # what is left, in small steps; nothing is tried from there, since working modes meet at a stretched leg
        rows = np.flatnonzero(~out.closed & out.closed[near].any(axis=1))
        at = self._nearest(out, near, rows)
        k = self._in_steps(out, at, position[rows])
        with np.errstate(invalid="ignore"):
            small = np.asarray((np.abs(k.coordinates - out.coordinates[at]) < TURN).all(axis=1))
        self._judge(out, rows, k, small)
        return out

    @staticmethod
    def _nearest(out: JudgedPoses, near: NDArray[np.int64], rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """The nearest closed neighbour of each."""
        return np.asarray(near[rows, out.closed[near[rows]].argmax(axis=1)])

    def _sound(self, out: JudgedPoses, neighbour: NDArray[np.int64], k: DriveKinematics) -> NDArray[np.bool_]:
        """Whether the way back to closed neighbours ends where it began: else Newton's method has fallen into another
        working mode."""
        start, same = out.coordinates[neighbour], np.zeros(len(neighbour), dtype=bool)
        rows = np.flatnonzero(k.status == Status.CONVERGED)
        back = self._from(out.position[neighbour[rows]], k.coordinates[rows])
        with np.errstate(invalid="ignore"):
            same[rows] = (np.abs(back.coordinates - start[rows]) < SAME).all(axis=1)
        return same

    def _in_steps(self, out: JudgedPoses, neighbour: NDArray[np.int64], p: Floats) -> DriveKinematics:
        """From closed neighbours in several steps, each begun at the last one that closed."""
        begin, x = out.position[neighbour], out.coordinates[neighbour]
        for share in STEPS:
            k = self._from(begin + share * (p - begin), x)
            x = np.where((k.status == Status.CONVERGED)[:, None], k.coordinates, x)
        return self._from(p, x)

    def _slowly(self, p: Floats) -> DriveKinematics:
        """Poses that may be at the border, continued from home in as many steps as that takes."""
        b = self.bounds
        start = kernel_starts(b.machine, p, b.rotation, b.threads)
        return drive_kinematics(
            b.machine, p, b.rotation, start=start, patient=start is None, threads=b.threads
        )

    def _from(self, p: Floats, start: Floats) -> DriveKinematics:
        b = self.bounds
        return drive_kinematics(b.machine, p, b.rotation, start=start, only_start=True, threads=b.threads)

    def _judge(
        self, out: JudgedPoses, rows: NDArray[np.int64], k: DriveKinematics, sound: NDArray[np.bool_] | None = None
    ) -> None:  # fmt: skip
        """Poses of these numbers, whose kinematics are at hand; those that are not sound count as not reached."""
        closed = k.status == Status.CONVERGED
        if sound is not None:
            closed &= sound
        inside = closed.copy()
        for table in out.broken.values():  # what an earlier attempt said
            table[rows] = False
        if self.singularity is not None:
            beyond, near = self._singular(k)
            out.mark(SINGULAR, rows, closed & (beyond | near))
            inside &= ~(beyond | near)
            closed &= ~beyond
        for limit in self.bounds.limits_of(k, out.position[rows]):
            bad = closed & ~(limit.value <= limit.most)
            out.mark(limit.name, rows, bad)
            inside &= ~bad
        out.closed[rows], out.inside[rows], out.coordinates[rows] = closed, inside, k.coordinates

    def _singular(self, k: DriveKinematics) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Beyond a singularity as seen from home; nearer to one than allowed."""
        v = transmission_of(self.bounds.machine, k, length=self.bounds.length)
        with np.errstate(invalid="ignore"):
            near = ~(distances(v, k.pivot).min(axis=0) >= (self.singularity or 0.0))
        if self._frame is None:
            return np.zeros_like(near), near
        frame, sign = self._frame
        j = weighted(self.bounds.machine, k.jacobian, self.bounds.size, "all")
        with np.errstate(invalid="ignore"):
            return np.asarray(sign * np.linalg.det(frame @ j) < 0), near

    @cached_property
    def _frame(self) -> tuple[Floats, float] | None:
        """(drives, 6) the motions that the drives command, and the sign of their determinant at home; None where
        the two are not as many, so that there is no such sign."""
        machine = self.bounds.machine
        home = drive_kinematics(machine, machine.description.home.p, self.bounds.rotation)
        j = weighted(machine, home.jacobian, self.bounds.size, "all")
        if not np.isfinite(j).all():
            return None
        rows = np.eye(6)[[TASK.index(c) for c in machine.description.task]]
        if len(rows) == 6 and j.shape[1] == 3 and not np.abs(j[3:]).max() > 1e-12 * np.abs(j).max():
            rows = rows[:3]  # a platform that cannot turn
        if len(rows) != j.shape[1]:
            return None
        return rows, float(np.sign(np.linalg.det(rows @ j)))
