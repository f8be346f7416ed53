"""Maps and designs on a local dask cluster of one and two workers against the same work in this process, by turns:
time by the clock, processor time of all processes, and what a task costs beside its work.

    OPENBLAS_NUM_THREADS=1 python bench/cluster.py [--edge 256] [--rounds 3]
"""

from __future__ import annotations

import argparse
import os
from statistics import median
from time import perf_counter, process_time
from typing import Any

import numpy as np
from distributed import Client, LocalCluster

import stiffmap as sm
from stiffmap.common.tasks import workers

PLANES = 10
TASKS = 100


def nothing(_: None, item: int) -> int:
    """A task without work."""
    return item


def processor(client: Any) -> float:
    """s of processor of this process and of the workers."""
    there = 0.0 if client is None else sum(client.run(_used).values())
    return process_time() + float(there)


def _used() -> float:
    t = os.times()
    return t.user + t.system


def a_map(edge: int, client: Any) -> tuple[float, int]:
    """Largest deflection of a map that is not stored, and its poses."""
    axis = np.linspace(-0.2, 0.3, edge)
    z = np.linspace(-0.2, 0.3, PLANES)
    load = {"wrench": [300, 0, 0, 0, 0, 0], "plane": None}
    ds = sm.map_statistics(
        "orthoglide-revised", x=axis, y=axis, z=z, threads=1, scheduler=client, progress=False, **load
    )
    return float(ds.deflection_max.max()), PLANES * edge**2


def main() -> None:
    """Tables to the terminal."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--edge", type=int, default=256)
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args()
    clusters = {
        n: LocalCluster(n_workers=n, threads_per_worker=1, dashboard_address=None, silence_logs=50)
        for n in (1, 2)
    }
    clients: dict[int, Any] = {0: None} | {n: Client(c, set_as_default=False) for n, c in clusters.items()}
    clock: dict[int, list[float]] = {n: [] for n in clients}
    cpu: dict[int, list[float]] = {n: [] for n in clients}
    for client in clients.values():
        a_map(64, client)  # loads the core everywhere
    answers: set[float] = set()
    for _ in range(given.rounds):
        for n, client in clients.items():
            t, p = perf_counter(), processor(client)
            value, poses = a_map(given.edge, client)
            cpu[n].append(processor(client) - p)
            clock[n].append(perf_counter() - t)
            answers.add(value)
            print(
                f"{n} workers: {clock[n][-1]:.2f} s by the clock, {cpu[n][-1]:.2f} s of processor", flush=True
            )
    assert len(answers) == 1, "the same answer everywhere"
    print(f"{poses} poses; load of the machine {os.getloadavg()[0]:.1f}")
    print(
        "| workers | clock, s: median (min … max) | processor, s: median | µs a pose, processor | efficiency by clock | by processor |"
    )
    print("|---|---|---|---|---|---|")
    for n in clients:
        wall, used = median(clock[n]), median(cpu[n])
        by_clock = median(a / (max(n, 1) * b) for a, b in zip(clock[0], clock[n], strict=True))
        by_cpu = median(a / b for a, b in zip(cpu[0], cpu[n], strict=True))
        print(
            f"| {n or 'in this process'} | {wall:.1f} ({min(clock[n]):.1f} … {max(clock[n]):.1f}) | {used:.1f} "
            f"| {1e6 * used / poses:.2f} | {by_clock:.2f} | {by_cpu:.2f} |"
        )
    for n in (1, 2):
        times, useds, begins = [], [], []
        for _ in range(given.rounds):
            t = perf_counter()
            with workers(nothing, None, scheduler=clients[n]) as hands:
                begins.append(perf_counter() - t)
                t, p = perf_counter(), process_time()
                hands.in_order(range(TASKS))
                times.append(perf_counter() - t)
                useds.append(process_time() - p)
        print(
            f"{n} workers, tasks without work: {1e3 * median(times) / TASKS:.2f} ms by the clock, "
            f"{1e3 * median(useds) / TASKS:.2f} ms of this process and the scheduler in it; begun in {median(begins):.2f} s"
        )
    for n in (1, 2):
        clients[n].close()
        clusters[n].close()


if __name__ == "__main__":
    main()
