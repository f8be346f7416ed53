"""The tiles of a map on a dask cluster."""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from functools import lru_cache
from typing import Any

from stiffmap.errors import MissingPartError, StiffmapError
from stiffmap.maps.plan import MapPlan
from stiffmap.maps.tiles import Tiles, solve_rows

WAITING_PER_THREAD = 2
"""Tiles given to each of the cluster's threads in advance; they bound the memory here."""
RETRIES = 5
"""Times that a tile is given out anew when the worker that had it is lost."""


def on_cluster(
    plan: MapPlan, tiles: Tiles, indices: Sequence[int], scheduler: Any
) -> Iterator[tuple[int, dict[str, Any]]]:
    """Solved tiles as they come, in any order. `scheduler`: an address, or a `distributed.Client`.

    Each worker unpacks the machine once. A lost worker's tiles are done again by others.
    """
    packed = pickle.dumps(plan)
    with client_of(scheduler) as client:
        from distributed import as_completed

        shared = _scattered(client, packed)
        left = iter(indices)
        given: dict[Any, tuple[int, int]] = {}  # of each future: its tile, and how often that was lost

        def submit(index: int, lost: int = 0) -> Any:
            rows = tiles.rows_of(index)
            future = client.submit(_solve, shared, rows.start, rows.stop, pure=False, retries=RETRIES)
            given[future] = index, lost
            return future

        threads = max(1, sum(client.nthreads().values()))
        first = [submit(i) for _, i in zip(range(WAITING_PER_THREAD * threads), left, strict=False)]
        running: Any = as_completed(first, loop=client.loop)  # type: ignore[no-untyped-call]
        for future in running:
            index, lost = given.pop(future)
            try:
                values = future.result()
            except CancelledError as error:  # a worker took the packed plan with it; dask gives such tasks up
                if lost == RETRIES:
                    raise StiffmapError(
                        f"scheduler: tile {index} was lost {lost + 1} times: {error}"
                    ) from error
                if shared.cancelled():
                    shared = _scattered(client, packed)
                running.add(submit(index, lost + 1))
                continue
            yield index, values
            future.release()
            following = next(left, None)
            if following is not None:
                running.add(submit(following))


def _scattered(client: Any, packed: bytes) -> Any:
    """The packed plan on every worker, under a key of its own: one that was lost is not found again."""
    return client.scatter([packed], broadcast=True, hash=False)[0]


@contextmanager
def client_of(scheduler: Any) -> Iterator[Any]:
    """A client of the cluster; one that was given stays open.

    MissingPartError without dask, StiffmapError where nothing answers or no worker is there.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise MissingPartError(
            "a cluster needs the packages dask and distributed: pip install 'stiffmap[cluster]'"
        ) from error
    if isinstance(scheduler, Client):
        yield scheduler
        return
    try:
        client: Any = Client(scheduler, timeout=10, set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, TimeoutError, ValueError) as error:
        raise StiffmapError(
            f"scheduler: expected the address of a running dask scheduler such as tcp://127.0.0.1:8786, "
            f"got {scheduler!r} ({error or type(error).__name__})"
        ) from error
    try:
        client.wait_for_workers(1, timeout=30)
    except TimeoutError as error:
        client.close()
        raise StiffmapError(f"scheduler: {scheduler} has no worker") from error
    with client:
        yield client


@lru_cache(maxsize=2)
def _unpacked(packed: bytes) -> MapPlan:
    plan: MapPlan = pickle.loads(packed)
    return plan


def _solve(packed: bytes, start: int, stop: int) -> dict[str, Any]:
    return solve_rows(_unpacked(packed), slice(start, stop))
