"""Volume of the workspace: poses that close and keep every limit, counted in random cells (docs/measures.md)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from stiffmap.common.broadcasting import Floats, random_numbers, real_number, trailing, whole_number
from stiffmap.common.errors import StiffmapError
from stiffmap.common.short import short_repr
from stiffmap.model.files.load import Source
from stiffmap.solve.machine import Machine, as_machine
from stiffmap.solve.options import keywords_of
from stiffmap.workspace.maps.inputs import read_region
from stiffmap.workspace.performance.box.inside import Inside, JudgedPoses
from stiffmap.workspace.performance.box.proof import Judge, halved, judge_on
from stiffmap.workspace.performance.limits.limits import Bounds

CELLS = {3: 24, 2: 120, 1: 1000}  # along each edge, by the number of axes
FIRST = {3: 7, 2: 20, 1: 50}  # the same while the workspace's extent is looked for
GROWN = 4  # most times that a region is made larger because the workspace reaches its border


@short_repr
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
    """What ends it: limit, and the share of the poses next to the border (of all where none is inside) that break it;
    the largest first."""
    drawn: JudgedPoses = field(repr=False)
    """All poses drawn."""
    ask: Inside = field(repr=False)
    """Judges more poses."""

    def at(self, position: ArrayLike) -> JudgedPoses:
        """Poses (n, 3) m judged likewise, each begun at the nearest one drawn."""
        return self.ask(trailing(position, (3,), "position", "positions (m)").reshape(-1, 3), self.drawn)


@keywords_of(Bounds)
def workspace_volume(
    machine: Machine | Source,
    *,
    singularity: float | None = 1e-3,
    region: ArrayLike | None = None,
    cells: int | None = None,
    prove: int = 0,
    seed: int = 0,
    scheduler: object = None,
    **limits: Any,
) -> Workspace:
    """Volume of all positions that the machine comes to in one orientation, with its sampling error.

    Poses are closed one from the other, from the middle of the machine's workspace outwards.

    Parameters
    ----------
    transmission, norm, length, ranges, joints, clearance, deflection, rotation
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
    scheduler
        Address of a dask scheduler, or a `distributed.Client`: its workers prove the cells, with the same answer.

    Raises
    ------
    StiffmapError
        For bad input.
    """
    machine = as_machine(machine)
    if singularity is not None and not 0 <= real_number(singularity, "singularity") < 1:
        raise StiffmapError(f"singularity: expected a distance from 0 to 1, got {singularity!r}")
    if cells is not None:
        whole_number(cells, "cells", 2, what="a whole number, 2 or more along each edge")
    whole_number(prove, "prove", 0)
    bounds = Bounds(machine, **limits)
    ask = Inside(bounds, singularity)
    rng = random_numbers(seed)
    axes = [i for i, name in enumerate("xyz") if name in machine.description.task]
    if not axes:
        raise StiffmapError(
            f"{machine.name}: the task has no position, so there is no workspace of positions"
        )
    cells = cells or CELLS[len(axes)]
    low, high = _begun(machine, axes) if region is None else read_region(region, axes)
    more = 0
    if region is None:
        drawn, _, low, high, more = _drawn(ask, low, high, axes, FIRST[len(axes)], rng, GROWN, 1 / 2)
        if drawn.inside.any():
            kept, step = drawn.position[drawn.inside], (high - low) / FIRST[len(axes)]
            low, high = np.maximum(kept.min(axis=0) - step, low), np.minimum(kept.max(axis=0) + step, high)
    drawn, touched, low, high, _ = _drawn(ask, low, high, axes, cells, rng, more, 1 / 4)
    cell = float(np.prod((high - low)[axes] / cells))
    pairs = drawn.inside.reshape(-1, 2)
    kept = drawn.position[drawn.inside]
    box = np.stack([kept.min(axis=0), kept.max(axis=0)]) if len(kept) else np.full((2, 3), np.nan)
    with judge_on(bounds, scheduler) as judge:
        provable = prove > 0 and not bounds.unproven and len(axes) == 3
        proven = _proven(judge, drawn, low, (high - low) / cells, cells, prove) if provable else float("nan")
    return Workspace(
        volume=cell * float(pairs.mean(axis=1).sum()),
        error=cell * float(np.sqrt((pairs[:, 0] != pairs[:, 1]).sum() / 4)),
        dimension=len(axes), proven=proven, box=box,
        region=np.stack([low, high]), cut=touched, limited_by=_limiting(drawn),
        drawn=drawn, ask=ask,
    )  # fmt: skip


def _begun(machine: Machine, axes: list[int]) -> tuple[Floats, Floats]:
    low, high = machine.workspace
    centre, half = (low + high) / 2, (high - low) / 2
    moves = np.isin(np.arange(3), axes)
    half = np.where(half == 0, half.max(), half)
    return centre - 3 * half * moves, centre + 3 * half * moves


def _drawn(
    ask: Inside, low: Floats, high: Floats, axes: list[int], cells: int, rng: np.random.Generator, more: int, by: float
) -> tuple[JudgedPoses, bool, Floats, Floats, int]:  # fmt: skip
    """Two random poses in each of cells^axes cells of a region, neighbours in memory. Where a cell of the border holds a pose
    inside, in a region that is larger there by this share, and so on `more` times; whether the last border holds one, the
    region, and how many times are left."""
    grid = np.stack(np.meshgrid(*[np.arange(cells)] * len(axes), indexing="ij"), axis=-1)
    corner = np.repeat(grid.reshape(-1, len(axes)), 2, axis=0)
    while True:
        p = np.tile((low + high) / 2, (len(corner), 1))
        p[:, axes] = low[axes] + (corner + rng.random(corner.shape)) * ((high - low)[axes] / cells)
        judged = ask(p)
        touched = np.zeros((2, 3))
        touched[:, axes] = [(judged.inside[:, None] & (corner == end)).any(axis=0) for end in (0, cells - 1)]
        if not touched.any() or more == 0:
            return judged, bool(touched.any()), low, high, more
        more, step = more - 1, by * (high - low)
        low, high = low - step * touched[0], high + step * touched[1]


def _limiting(drawn: JudgedPoses) -> tuple[tuple[str, float], ...]:
    """What the poses break that are outside but have one inside for a neighbour; all poses where none is inside."""
    border = ~drawn.inside
    if drawn.inside.any():
        step = np.median(cKDTree(drawn.position).query(drawn.position, 2)[0][:, 1])
        border &= cKDTree(drawn.position[drawn.inside]).query(drawn.position)[0] < 2 * step
    if not border.any():
        return ()
    shares = {name: float(bad[border].mean()) for name, bad in drawn.causes().items()}
    found = [(name, share) for name, share in shares.items() if share > 0]
    return tuple(sorted(found, key=lambda f: -f[1]))


def _proven(judge: Judge, drawn: JudgedPoses, low: Floats, step: Floats, cells: int, work: int) -> float:
    """Volume of the cells (halved where that decides) every pose of which was proven to keep the limits."""
    number = np.flatnonzero(drawn.inside.reshape(-1, 2).all(axis=1))
    corner = np.stack(np.unravel_index(number, (cells,) * 3), axis=1)
    a = low + corner * step
    b, total, left = a + step, 0.0, work
    while len(a) and left > 0:
        a, b = a[:left], b[:left]
        left -= len(a)
        found = judge((a + b) / 2, (b - a) / 2, np.eye(3))
        total += float(np.prod(b - a, axis=1)[found.inside].sum())
        open_ = ~found.inside & ~found.broken
        a, b = halved(a[open_], b[open_], found.bend[open_])
    return total
