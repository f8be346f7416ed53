"""A map in tiles: parts of one z-plane that are solved, written and done again on their own, here or on a cluster."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stiffmap.common.broadcasting import whole_number
from stiffmap.common.tasks import workers
from stiffmap.workspace.maps.block import solve_block
from stiffmap.workspace.maps.plan import MapPlan

TILE_POSES = 65536
"""Poses of a tile. It decides the bytes of a Zarr map, so it depends on nothing but the grid."""
POSES_AT_ONCE = 1024


@dataclass(frozen=True)
class Tiles:
    """How a grid is cut: rows of all x, `height` of them at one z."""

    planes: int
    rows: int
    """Rows of a plane."""
    height: int

    @property
    def per_plane(self) -> int:
        """Tiles of one plane."""
        return -(-self.rows // self.height)

    @property
    def count(self) -> int:
        """Tiles of the map."""
        return self.planes * self.per_plane

    def place(self, index: int) -> tuple[int, slice]:
        """Plane and rows of it (indices of z and y)."""
        plane, part = divmod(index, self.per_plane)
        return plane, slice(part * self.height, min((part + 1) * self.height, self.rows))

    def rows_of(self, index: int) -> slice:
        """Rows counted over the whole map."""
        plane, y = self.place(index)
        return slice(plane * self.rows + y.start, plane * self.rows + y.stop)

    @property
    def parts(self) -> list[slice]:
        """Rows of every tile."""
        return [self.rows_of(i) for i in range(self.count)]


def tiles_of(plan: MapPlan) -> Tiles:
    """The tiles of a map."""
    height = max(1, min(plan.y.size, TILE_POSES // plan.x.size))
    return Tiles(plan.z.size, plan.y.size, height)


def blocks_of(rows: slice, width: int, poses: int) -> list[slice]:
    """Rows cut so that a block has about `poses` poses."""
    step = max(1, poses // width)
    return [slice(i, min(i + step, rows.stop)) for i in range(rows.start, rows.stop, step)]


def solve_rows(plan: MapPlan, rows: slice, poses: int = POSES_AT_ONCE) -> dict[str, Any]:
    """Every variable (rows, x, ...) of some rows, solved block by block."""
    parts = [solve_block(plan, block) for block in blocks_of(rows, plan.x.size, poses)]
    shape = (rows.stop - rows.start, plan.x.size)
    return {
        v.name: np.concatenate([p[v.name] for p in parts]).reshape(shape + plan.tail(v))
        for v in plan.variables
    }


@dataclass(frozen=True)
class Work:
    """Who solves a map: this process, about so many poses at once, or the workers of a cluster."""

    poses: int
    scheduler: Any = None
    """Address of a dask scheduler, or a `distributed.Client`."""

    def parts(self, plan: MapPlan) -> list[slice]:
        """All rows, in parts that are kept as soon as they are solved."""
        if self.scheduler is None:
            return blocks_of(slice(0, plan.rows), plan.x.size, self.poses)
        return tiles_of(plan).parts

    def solved(self, plan: MapPlan, parts: Sequence[slice]) -> Iterator[tuple[int, dict[str, Any]]]:
        """Number and values of each part: in order here, as they come from a cluster."""
        if self.scheduler is None:
            yield from ((i, solve_rows(plan, rows, self.poses)) for i, rows in enumerate(parts))
            return
        with workers(_solve, plan, scheduler=self.scheduler) as cluster:
            yield from cluster.as_done((rows.start, rows.stop) for rows in parts)


def work_of(chunk: int | None, scheduler: Any) -> Work:
    """By the arguments `chunk` and `scheduler` of `stiffmap.error_map`."""
    return Work(POSES_AT_ONCE if chunk is None else whole_number(chunk, "chunk", 1), scheduler)


def _solve(plan: MapPlan, rows: tuple[int, int]) -> dict[str, Any]:
    return solve_rows(plan, slice(*rows))
