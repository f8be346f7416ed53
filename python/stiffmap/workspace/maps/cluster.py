"""The tiles of a map on a dask cluster."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from stiffmap.common.tasks import workers
from stiffmap.workspace.maps.plan import MapPlan
from stiffmap.workspace.maps.tiles import Tiles, solve_rows


def on_cluster(
    plan: MapPlan, tiles: Tiles, indices: Sequence[int], scheduler: Any
) -> Iterator[tuple[int, dict[str, Any]]]:
    """Solved tiles as they come, in any order. `scheduler`: an address, or a `distributed.Client`."""
    with workers(_solve, plan, scheduler=scheduler) as cluster:
        rows = (tiles.rows_of(i) for i in indices)
        for number, values in cluster.as_done((r.start, r.stop) for r in rows):
            yield indices[number], values


def _solve(plan: MapPlan, rows: tuple[int, int]) -> dict[str, Any]:
    return solve_rows(plan, slice(*rows))
