"""A map in tiles: parts of one z-plane that are solved, written and done again on their own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

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
