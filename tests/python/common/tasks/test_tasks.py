"""Tasks here, in processes and on a cluster that loses workers: the same results, each once."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import stiffmap as sm
from stiffmap.common.tasks import workers
from stiffmap.workspace.design import optimize

ITEMS = [float(k) for k in range(25)]


def power(shared: dict[str, float], item: float) -> float:
    """A task."""
    time.sleep(shared["seconds"])
    if item == shared.get("bad"):
        raise ValueError(f"no power of {item}")
    return item ** shared["exponent"]


def blas_threads(_: None, item: int) -> set[int]:
    """A task whose last digits would depend on where it is done."""
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


EXPECTED = [x**3.0 for x in ITEMS]
DESIGN = """
name: small
machine: orthoglide-revised
variables:
  carriage: {low: 1, high: 9}
  drive: {low: 1.0e-5, high: 2.0e-4}
numbers:
  templates.leg.body[carriage].mass: carriage
  templates.leg.actuator[actuator].compliance: drive
objectives: [mass, frequency]
search: {population: 6, generations: 2, seed: 4, nodes: 2}
"""


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
        ) as here,
        distributed.Client(here, set_as_default=False) as client,
    ):
        yield client


@pytest.mark.parametrize("processes", [1, 2])
def test_linear_algebra_of_a_task_has_one_thread(processes: int) -> None:
    with threadpool_limits(3, "blas"), workers(blas_threads, None, processes=processes) as hands:
        assert hands.in_order(range(3)) == [{1}] * 3


def lose(cluster: Any, number: int) -> None:
    """Kills workers as a power cut would."""
    for process in list(cluster.run(os.getpid).values())[:number]:
        os.kill(process, signal.SIGKILL)


@pytest.mark.parametrize("processes", [1, 2])
def test_here(processes: int) -> None:
    with workers(power, {"exponent": 3.0, "seconds": 0.0}, processes=processes) as hands:
        assert hands.in_order(ITEMS) == EXPECTED
        assert sorted(hands.as_done(ITEMS[:4])) == list(enumerate(EXPECTED[:4]))
        assert hands.in_order([]) == []


@pytest.mark.parametrize("processes", [1, 2])
def test_an_error_of_a_task_is_raised(processes: int) -> None:
    with (
        workers(power, {"exponent": 3.0, "seconds": 0.0, "bad": 7.0}, processes=processes) as hands,
        pytest.raises(ValueError, match=r"no power of 7\.0"),
    ):
        hands.in_order(ITEMS)


def test_a_scheduler_that_does_not_answer_is_said() -> None:
    pytest.importorskip("distributed")
    with pytest.raises(sm.StiffmapError, match="expected the address of a running dask scheduler"):
        optimize("redesign", generations=1, scheduler="nonsense://1")


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("lost", [1, 2], ids=["one", "all, and what they share with them"])
def test_a_cluster_that_loses_workers(cluster: Any, lost: int) -> None:
    found = {}
    with workers(power, {"exponent": 3.0, "seconds": 0.02}, scheduler=cluster) as hands:
        for number, value in hands.as_done(iter(ITEMS)):
            assert number not in found
            found[number] = value
            if len(found) == 2:
                lose(cluster, lost)
    assert [found[i] for i in range(len(ITEMS))] == EXPECTED


@pytest.mark.filterwarnings("ignore")
def test_an_error_on_the_cluster_is_raised(cluster: Any) -> None:
    with (
        workers(power, {"exponent": 3.0, "seconds": 0.0, "bad": 7.0}, scheduler=cluster) as hands,
        pytest.raises(ValueError, match=r"no power of 7\.0"),
    ):
        hands.in_order(ITEMS)


@pytest.mark.filterwarnings("ignore")
def test_a_design_search_that_loses_a_worker(cluster: Any, tmp_path: Path) -> None:
    pytest.importorskip("pymoo")
    problem = tmp_path / "small.yaml"
    problem.write_text(DESIGN, encoding="utf-8")
    here = optimize(problem, processes=1)

    def tell(generation: int, *_: Any) -> None:
        if generation == 1:
            lose(cluster, 1)

    there = optimize(problem, scheduler=cluster, progress=tell)
    np.testing.assert_array_equal(there.x, here.x)
    assert [j.values for j in there.judged] == [j.values for j in here.judged]
