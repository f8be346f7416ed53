"""Many independent tasks: here, in processes, or on a dask cluster. One room for all that takes minutes (docs/big_maps.md)."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache, wraps
from itertools import islice
from multiprocessing import get_context
from typing import Any, ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

from stiffmap.common.errors import StiffmapError, needed

Function = Callable[[Any, Any], Any]
"""A task: of what all share, and of its own item. It stands in a module, so that others can import it."""
WAITING_PER_PROCESS = 4
WAITING_PER_THREAD = 2
"""Tasks given to each of the cluster's threads in advance; they bound the memory here."""
PATIENCE = 60
"""s to wait for a worker where all are lost."""
RETRIES = 5
"""Times that a task is given out anew when the worker that had it is lost."""
P = ParamSpec("P")
T = TypeVar("T")


def on_one_thread(function: Callable[P, T]) -> Callable[P, T]:
    """The function with numpy's and scipy's matrix products on one thread; threads of the core stay as they are. A fit's matrices are
    small, and threads of BLAS would mostly wait for each other."""

    @wraps(function)
    def limited(*args: P.args, **kwargs: P.kwargs) -> T:
        with threadpool_limits(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return limited


@dataclass(frozen=True)
class Workers:
    """Does the same function of many items."""

    as_done: Callable[[Iterable[Any]], Iterator[tuple[int, Any]]]
    """(number, result) of each item as they come, in any order."""

    def in_order(self, items: Iterable[object]) -> list[Any]:
        """Results of all items, in their order."""
        found = dict(self.as_done(items))
        return [found[i] for i in range(len(found))]


@contextmanager
def workers(
    function: Function, shared: Any, *, scheduler: object = None, processes: int = 1
) -> Iterator[Workers]:
    """Who does `function(shared, item)`; the results are the same everywhere, since linear algebra has one thread.

    scheduler
        Address of a dask scheduler, or a `distributed.Client`, which stays open. Each worker gets `shared` once; what a
        lost worker had in hand is done again by others. None: here.
    processes
        Here: this many processes, 1: this one.

    MissingPartError without dask, StiffmapError where nothing answers or where a task was lost again and again.
    """
    if scheduler is not None:
        with client_of(scheduler) as client:
            yield Workers(OnCluster(client, function, shared).as_done)
    elif processes == 1:
        here = on_one_thread(function)
        yield Workers(lambda items: ((i, here(shared, item)) for i, item in enumerate(items)))
    else:
        with ProcessPoolExecutor(
            processes, mp_context=get_context("spawn"), initializer=_begin, initargs=(function, shared)
        ) as pool:
            yield Workers(lambda items: _pooled(pool, items, WAITING_PER_PROCESS * processes))


_GIVEN: list[tuple[Function, Any]] = []


def _begin(function: Function, shared: object) -> None:
    _GIVEN[:] = [(function, shared)]


def _one(item: object) -> object:
    function, shared = _GIVEN[0]
    return on_one_thread(function)(shared, item)


def _pooled(pool: ProcessPoolExecutor, items: Iterable[object], waiting: int) -> Iterator[tuple[int, object]]:
    """Results of a pool, with a bounded number of items given out in advance."""
    numbered = enumerate(items)
    given = {pool.submit(_one, item): i for i, item in islice(numbered, waiting)}
    while given:
        future = next(as_completed(given))
        yield given.pop(future), future.result()
        for i, item in islice(numbered, 1):
            given[pool.submit(_one, item)] = i


class OnCluster:
    """Gives tasks to the workers of a client."""

    def __init__(self, client: Any, function: Function, shared: object) -> None:
        self._client, self._function = client, function
        self._packed = pickle.dumps(shared)
        self._there = self._scattered()

    def as_done(self, items: Iterable[object]) -> Iterator[tuple[int, object]]:
        """(number, result) of each item as they come. A lost worker's tasks are done again by others."""
        import distributed

        numbered = enumerate(items)
        given: dict[Any, tuple[int, Any, int]] = {}  # of each future: number, item, how often it was lost

        def submit(index: int, item: object, lost: int = 0) -> object:
            future = self._client.submit(_do, self._function, self._there, item, pure=False, retries=RETRIES)
            given[future] = index, item, lost
            return future

        threads = max(1, sum(self._client.nthreads().values()))
        first = [submit(i, item) for i, item in islice(numbered, WAITING_PER_THREAD * threads)]
        running: Any = distributed.as_completed(first, loop=self._client.loop)  # type: ignore[no-untyped-call]
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
def client_of(scheduler: Any) -> Iterator[object]:
    """A client of the cluster; one that was given stays open.

    MissingPartError without dask, StiffmapError where nothing answers or no worker is there.
    """
    with needed("a cluster", "cluster"):
        from distributed import Client
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
def _unpacked(packed: bytes) -> object:
    return pickle.loads(packed)


def _do(function: Function, packed: bytes, item: object) -> object:
    return on_one_thread(function)(_unpacked(packed), item)
