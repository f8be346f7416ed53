"""Tasks on a dask cluster."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from functools import lru_cache
from itertools import islice
from typing import Any

from stiffmap.common.errors import MissingPartError, StiffmapError
from stiffmap.common.one_thread import on_one_thread

WAITING_PER_THREAD = 2
"""Tasks given to each of the cluster's threads in advance; they bound the memory here."""
PATIENCE = 60
"""s to wait for a worker where all are lost."""
RETRIES = 5
"""Times that a task is given out anew when the worker that had it is lost."""


class OnCluster:
    """Gives tasks to the workers of a client."""

    def __init__(self, client: Any, function: Callable[[Any, Any], Any], shared: Any) -> None:
        self._client, self._function = client, function
        self._packed = pickle.dumps(shared)
        self._there = self._scattered()

    def as_done(self, items: Iterable[Any]) -> Iterator[tuple[int, Any]]:
        """(number, result) of each item as they come. A lost worker's tasks are done again by others."""
        from distributed import as_completed

        numbered = enumerate(items)
        given: dict[Any, tuple[int, Any, int]] = {}  # of each future: number, item, how often it was lost

        def submit(index: int, item: Any, lost: int = 0) -> Any:
            future = self._client.submit(_do, self._function, self._there, item, pure=False, retries=RETRIES)
            given[future] = index, item, lost
            return future

        threads = max(1, sum(self._client.nthreads().values()))
        first = [submit(i, item) for i, item in islice(numbered, WAITING_PER_THREAD * threads)]
        running: Any = as_completed(first, loop=self._client.loop)  # type: ignore[no-untyped-call]
        try:
            for future in running:
                index, item, lost = given.pop(future)
                try:
                    result = future.result()
                except CancelledError as error:  # a worker took `shared` with it; dask gives such tasks up
                    if lost == RETRIES:
                        raise StiffmapError(
                            f"scheduler: task {index} was lost {lost + 1} times: {error}"
                        ) from error
                    if self._there.cancelled():
                        self._there = self._scattered()
                    running.add(submit(index, item, lost + 1))
                    continue
                yield index, result
                future.release()
                for i, following in islice(numbered, 1):
                    running.add(submit(i, following))
        finally:
            if given:  # Ctrl-C, or an error: nobody waits for the rest
                self._client.cancel(list(given))

    def _scattered(self) -> Any:
        """What all tasks share on every worker, under a key of its own: one that was lost is not found again."""
        try:
            self._client.wait_for_workers(1, timeout=PATIENCE)  # lost ones may be on their way back
            return self._client.scatter([self._packed], broadcast=True, hash=False)[0]
        except TimeoutError as error:
            raise StiffmapError(f"scheduler: no worker is left, and none came within {PATIENCE} s") from error


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
    except (OSError, TimeoutError, ValueError, TypeError) as error:
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
def _unpacked(packed: bytes) -> Any:
    return pickle.loads(packed)


def _do(function: Callable[[Any, Any], Any], packed: bytes, item: Any) -> Any:
    return on_one_thread(function)(_unpacked(packed), item)
