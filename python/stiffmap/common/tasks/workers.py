"""Who does the tasks: this process, processes started by it, or the workers of a cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from multiprocessing import get_context
from typing import Any

from stiffmap.common.one_thread import on_one_thread
from stiffmap.common.tasks.cluster import OnCluster, client_of

Function = Callable[[Any, Any], Any]
"""A task: of what all share, and of its own item. It stands in a module, so that others can import it."""
WAITING_PER_PROCESS = 4


@dataclass(frozen=True)
class Workers:
    """Does the same function of many items."""

    as_done: Callable[[Iterable[Any]], Iterator[tuple[int, Any]]]
    """(number, result) of each item as they come, in any order."""

    def in_order(self, items: Iterable[Any]) -> list[Any]:
        """Results of all items, in their order."""
        found = dict(self.as_done(items))
        return [found[i] for i in range(len(found))]


@contextmanager
def workers(
    function: Function, shared: Any, *, scheduler: Any = None, processes: int = 1
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


def _begin(function: Function, shared: Any) -> None:
    _GIVEN[:] = [(function, shared)]


def _one(item: Any) -> Any:
    function, shared = _GIVEN[0]
    return on_one_thread(function)(shared, item)


def _pooled(pool: ProcessPoolExecutor, items: Iterable[Any], waiting: int) -> Iterator[tuple[int, Any]]:
    """Results of a pool, with a bounded number of items given out in advance."""
    numbered = enumerate(items)
    given = {pool.submit(_one, item): i for i, item in islice(numbered, waiting)}
    while given:
        future = next(as_completed(given))
        yield given.pop(future), future.result()
        for i, item in islice(numbered, 1):
            given[pool.submit(_one, item)] = i
