"""Fits do not start threads of BLAS; what the caller had set is back afterwards."""

from __future__ import annotations

import numpy as np
from threadpoolctl import threadpool_info, threadpool_limits

import stiffmap as sm
from stiffmap.common.tasks import on_one_thread
from stiffmap.experiment import random_plan, simulate


def blas_threads() -> set[int]:
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


def test_inside_it_is_one_thread_and_afterwards_as_before() -> None:
    np.eye(2) @ np.eye(2)
    with threadpool_limits(limits=2, user_api="blas"):
        before = blas_threads()
        assert on_one_thread(blas_threads)() == {1}
        assert blas_threads() == before


def test_a_diagnosis_runs_on_one() -> None:
    machine = sm.load_machine("orthoglide-revised")
    data = simulate(
        machine, random_plan(machine, "deflection", poses=6, loads=3, repeats=2, seed=1), [], seed=3
    )
    seen: set[int] = set()
    with threadpool_limits(limits=2, user_api="blas"):
        sm.diagnose(machine, data, cross_validate=False, progress=lambda *_: seen.update(blas_threads()))
    assert seen == {1}
