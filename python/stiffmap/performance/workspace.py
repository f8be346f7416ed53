"""Volume of the workspace: poses that close and keep every limit, counted in random cells (docs/measures.md)."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from stiffmap.broadcasting import Floats
from stiffmap.description.machine import TASK
from stiffmap.errors import StiffmapError
from stiffmap.machine import Machine, takes_machine
from stiffmap.performance.cells import halved
from stiffmap.performance.closing import DriveKinematics, drive_kinematics, kernel_starts
from stiffmap.performance.kinds.singularity import distances
from stiffmap.performance.limits import Bounds
from stiffmap.performance.scaling import weighted
from stiffmap.performance.velocity import transmission_of
from stiffmap.rotations import as_rotations
from stiffmap.status import Status

CELLS = {3: 24, 2: 120, 1: 1000}
"""Along each edge, by the number of axes."""
FIRST = {3: 7, 2: 20, 1: 50}
"""The same while the workspace's extent is looked for."""
GROWN = 4
"""Most times that a region is made larger because the workspace reaches its border."""
NEIGHBOURS = 8
"""Of every pose: from those that close, it is tried next."""
TURN = 0.5
"""m, rad: most that a coordinate may change on the way to a neighbour at the border."""
STEPS = (0.03, 0.1, 0.3, 0.6, 0.9)
SAME = 1e-2
"""m, rad: coordinates that are the same; those of stretched legs are known by half their digits."""
REACH = "reach"
SINGULAR = "singularity"


@dataclass(frozen=True, eq=False)
class Workspace:
    """Volume, and where it ends."""

    volume: float
    """m³; of a machine that moves in a plane m², along a line m."""
    error: float
    """Standard error of `volume`, from the two poses of every cell: in two of three cases it is nearer."""
    dimension: int
    """3, 2 or 1: over how many axes `volume` is taken."""
    proven: float
    """Lower bound: cells proven by enclosures; NaN where it was not asked for or cannot be had."""
    box: Floats
    """(2, 3) m, lowest and highest corner of the poses that were found inside."""
    region: Floats
    """(2, 3) m, where poses were drawn."""
    cut: bool
    """Whether the workspace reaches the region's border, so that there may be more of it outside."""
    limited_by: tuple[tuple[str, float], ...]
    """What ends it: limit, and the share of the poses next to the border that break it; the largest first."""
    drawn: Judged = field(repr=False)
    """All poses drawn."""
    ask: Inside = field(repr=False)
    """Judges more poses."""

    def at(self, position: ArrayLike) -> Judged:
        """Poses (n, 3) m judged likewise, each begun at the nearest one drawn."""
        return self.ask(np.asarray(position, dtype=float).reshape(-1, 3), self.drawn)


@dataclass(frozen=True, eq=False)
class Judged:
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

    @classmethod
    def of(cls, position: Floats, coordinates: int) -> Judged:
        """Nothing known yet."""
        n = len(position)
        none = np.zeros(n, dtype=bool)
        return cls(position, none.copy(), none.copy(), np.full((n, coordinates), np.nan), {})

    def mark(self, name: str, rows: NDArray[np.int64], bad: NDArray[np.bool_]) -> None:
        """These of the rows break a limit, or its other end."""
        self.broken.setdefault(name, np.zeros(len(self.position), dtype=bool))[rows] |= bad

    def forget(self, rows: NDArray[np.int64]) -> None:
        """What an earlier attempt said of these."""
        for table in self.broken.values():
            table[rows] = False

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

    def __call__(self, position: Floats, known: Judged | None = None) -> Judged:
        """Judges poses (n, 3): each begins at a neighbour that closed, the first ones at the middle of the workspace;
        or all of them at the nearest one of poses that are known."""
        out = Judged.of(position, len(self.bounds.machine.compiled.names.coordinates))
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
            self._judge(out, rows, *self._beside(out, near[rows, lit[rows].argmax(axis=1)], position[rows]))
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
    def _nearest(out: Judged, near: NDArray[np.int64], rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """The nearest closed neighbour of each."""
        return np.asarray(near[rows, out.closed[near[rows]].argmax(axis=1)])

    def _beside(
        self, out: Judged, neighbour: NDArray[np.int64], p: Floats
    ) -> tuple[DriveKinematics, NDArray[np.bool_]]:
        """Poses from closed neighbours, and whether the way back ends where it began: else Newton's method has
        fallen into another working mode."""
        k = self._from(p, out.coordinates[neighbour])
        return k, self._sound(out, neighbour, k)

    def _sound(self, out: Judged, neighbour: NDArray[np.int64], k: DriveKinematics) -> NDArray[np.bool_]:
        start, same = out.coordinates[neighbour], np.zeros(len(neighbour), dtype=bool)
        rows = np.flatnonzero(k.status == Status.CONVERGED)
        back = self._from(out.position[neighbour[rows]], k.coordinates[rows])
        with np.errstate(invalid="ignore"):
            same[rows] = (np.abs(back.coordinates - start[rows]) < SAME).all(axis=1)
        return same

    def _in_steps(self, out: Judged, neighbour: NDArray[np.int64], p: Floats) -> DriveKinematics:
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
        return drive_kinematics(b.machine, p, b.rotation, start=start, patient=False, threads=b.threads)

    def _judge(
        self,
        out: Judged,
        rows: NDArray[np.int64],
        k: DriveKinematics,
        sound: NDArray[np.bool_] | None = None,
    ) -> None:
        """Poses of these numbers, whose kinematics are at hand; those that are not sound count as not reached."""
        closed = k.status == Status.CONVERGED
        if sound is not None:
            closed &= sound
        inside = closed.copy()
        out.forget(rows)
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


@takes_machine
def workspace_volume(
    machine: Machine,
    *,
    transmission: tuple[float, float] | None = None,
    factors: str = "sphere",
    length: float | None = None,
    ranges: bool = True,
    joints: bool = True,
    singularity: float | None = 1e-3,
    clearance: float | None = None,
    deflection: tuple[float, str | None, float] | None = None,
    rotation: ArrayLike | None = None,
    region: ArrayLike | None = None,
    cells: int | None = None,
    prove: int = 0,
    seed: int = 0,
    threads: int | None = None,
) -> Workspace:
    """Volume of all positions that the machine comes to in one orientation, with its sampling error.

    Poses are closed one from the other, from the middle of the machine's workspace outwards.

    Parameters
    ----------
    transmission, factors, length, ranges, joints, clearance, deflection, rotation
        Limits that a pose must keep, as in `largest_box`.
    singularity
        Least distance from singularities (measure ``singularity``: type 1, type 2, constraint; 0 to 1). Poses
        beyond a singularity, as seen from home, do not count. None: not asked for.
    region
        (2, 3) m, where poses are drawn; None: about all that is found, begun with three times the workspace.
    cells
        Along each edge of the region: two poses are drawn at random in each, and their differences give the error.
        None: 24 in space, 120 in a plane, 1000 along a line.
    prove
        Cells at most that are asked for a proof of all of their poses; their volume is a lower bound.
    seed
        Of the random poses.

    Raises StiffmapError for bad input.
    """
    if singularity is not None and not 0 <= singularity < 1:
        raise StiffmapError(f"singularity: expected a distance from 0 to 1, got {singularity!r}")
    if cells is not None and cells < 2:
        raise StiffmapError(f"cells: expected 2 or more along each edge, got {cells!r}")
    given = None if rotation is None else as_rotations(np.asarray(rotation, dtype=float))
    bounds = Bounds(
        machine, given, transmission, factors, length, ranges, joints, clearance, deflection, threads
    )
    ask = Inside(bounds, singularity)
    rng = np.random.default_rng(seed)
    axes = [i for i, name in enumerate("xyz") if name in machine.description.task]
    if not axes:
        raise StiffmapError(
            f"{machine.name}: the task has no position, so there is no workspace of positions"
        )
    cells = cells or CELLS[len(axes)]
    low, high = _begun(machine, region, axes)
    grown = 0 if region is not None else GROWN
    if region is None:
        low, high, grown = _extent(ask, low, high, axes, rng)
    while True:
        drawn = _draw(ask, low, high, axes, cells, rng)
        if not drawn.touched.any() or grown == 0:
            break
        grown -= 1
        step = (high - low) / 4
        low, high = low - step * drawn.touched[0], high + step * drawn.touched[1]
    cell = float(np.prod((high - low)[axes] / cells))
    pairs = drawn.judged.inside.reshape(-1, 2)
    kept = drawn.judged.position[drawn.judged.inside]
    box = np.stack([kept.min(axis=0), kept.max(axis=0)]) if len(kept) else np.full((2, 3), np.nan)
    return Workspace(
        volume=cell * float(pairs.mean(axis=1).sum()),
        error=cell * float(np.sqrt((pairs[:, 0] != pairs[:, 1]).sum() / 4)),
        dimension=len(axes), proven=_proven(bounds, drawn, low, high, axes, cells, prove), box=box,
        region=np.stack([low, high]), cut=bool(drawn.touched.any()), limited_by=_limiting(drawn),
        drawn=drawn.judged, ask=ask,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Drawn:
    judged: Judged
    touched: NDArray[np.bool_]
    """(2, 3) at which end of each axis a cell of the region's border holds a pose inside."""


def _begun(machine: Machine, region: ArrayLike | None, axes: list[int]) -> tuple[Floats, Floats]:
    low, high = machine.workspace
    if region is not None:
        out = np.asarray(region, dtype=float)
        if out.shape != (2, 3) or not (np.isfinite(out).all() and (out[1] > out[0])[axes].all()):
            raise StiffmapError(f"region: expected lowest and highest corner (2, 3) in m, got {region!r}")
        return out[0], out[1]
    centre, half = (low + high) / 2, (high - low) / 2
    moves = np.isin(np.arange(3), axes)
    half = np.where(half == 0, half.max(), half)
    return centre - 3 * half * moves, centre + 3 * half * moves


def _extent(
    ask: Inside, low: Floats, high: Floats, axes: list[int], rng: np.random.Generator
) -> tuple[Floats, Floats, int]:
    """A region about all that is found, and how many times it may still grow."""
    for left in range(GROWN, -1, -1):
        drawn = _draw(ask, low, high, axes, FIRST[len(axes)], rng)
        if not drawn.judged.inside.any() or not drawn.touched.any() or left == 0:
            break
        step = (high - low) / 2
        low, high = low - step * drawn.touched[0], high + step * drawn.touched[1]
    if drawn.judged.inside.any():
        kept, step = drawn.judged.position[drawn.judged.inside], (high - low) / FIRST[len(axes)]
        low, high = np.maximum(kept.min(axis=0) - step, low), np.minimum(kept.max(axis=0) + step, high)
    return low, high, left


def _draw(
    ask: Inside, low: Floats, high: Floats, axes: list[int], cells: int, rng: np.random.Generator
) -> _Drawn:
    """Two random poses in each of cells^axes cells, neighbours in memory."""
    grid = np.stack(np.meshgrid(*[np.arange(cells)] * len(axes), indexing="ij"), axis=-1)
    corner = np.repeat(grid.reshape(-1, len(axes)), 2, axis=0)
    p = np.tile((low + high) / 2, (len(corner), 1))
    p[:, axes] = low[axes] + (corner + rng.random(corner.shape)) * ((high - low)[axes] / cells)
    judged = ask(p)
    inside = judged.inside
    touched = np.zeros((2, 3), dtype=bool)
    for i, axis in enumerate(axes):
        touched[0, axis] = inside[corner[:, i] == 0].any()
        touched[1, axis] = inside[corner[:, i] == cells - 1].any()
    return _Drawn(judged, touched)


def _limiting(drawn: _Drawn) -> tuple[tuple[str, float], ...]:
    """What the poses break that are outside but have one inside for a neighbour."""
    if not drawn.judged.inside.any() or drawn.judged.inside.all():
        return ()
    step = np.median(cKDTree(drawn.judged.position).query(drawn.judged.position, 2)[0][:, 1])
    far = cKDTree(drawn.judged.position[drawn.judged.inside]).query(drawn.judged.position)[0]
    border = ~drawn.judged.inside & (far < 2 * step)
    if not border.any():
        return ()
    shares = {name: float(bad[border].mean()) for name, bad in drawn.judged.causes().items()}
    found = [(name, share) for name, share in shares.items() if share > 0]
    return tuple(sorted(found, key=lambda f: -f[1]))


def _proven(
    bounds: Bounds, drawn: _Drawn, low: Floats, high: Floats, axes: list[int], cells: int, work: int
) -> float:
    """Volume of the cells (halved where that decides) every pose of which was proven to keep the limits."""
    if work <= 0 or bounds.unproven or len(axes) != 3:
        return float("nan")
    step = (high - low) / cells
    number = np.flatnonzero(drawn.judged.inside.reshape(-1, 2).all(axis=1))
    corner = np.stack(np.unravel_index(number, (cells,) * 3), axis=1)
    a = low + corner * step
    b, total, left = a + step, 0.0, work
    while len(a) and left > 0:
        a, b = a[:left], b[:left]
        left -= len(a)
        found = bounds.over((a + b) / 2, (b - a) / 2, np.eye(3))
        total += float(np.prod(b - a, axis=1)[found.inside].sum())
        open_ = ~found.inside & ~found.broken
        a, b = halved(a[open_], b[open_], found.bend[open_])
    return total
