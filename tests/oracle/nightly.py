"""Thousands of random machines against two independent oracles: `energy` (loop coordinates, energy minimised) for the
families of `generate`, `cartesian` (bodies, constraints) for the classes of `classes` and for those families as well.
Numbers, and every status against the eigenvalues of the energy's Hessian over the motions that keep the loops closed.

usage: python -m tests.oracle.nightly --count 1000 [--first 0] [--only "spinning rods" ...] [--jobs 2]
           [--out build/nightly.jsonl] [--scheduler tcp://HOST:8786]

Of every eight seeds one is a machine of `generate`, seven are of `classes`. With --out a run goes on where it was stopped.
A machine at which the program dies is one that disagrees. Workers of a cluster are started in the repository's folder.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

import stiffmap as sm
from stiffmap import Flag, Status
from stiffmap.common.tasks import on_one_thread, workers

from .alter import slopes, with_one_effect
from .cartesian.structure import Unsupported
from .check import checks
from .classes import Classes
from .compare import Comparison, compare, reached
from .generate import Generator
from .tasks import Task

LIMIT = 1e-8
OFF = 1e-8  # m, rad: from the core's coordinates to the equilibrium
CRITICAL = 1e-9  # lowest eigenvalue over the largest: too small to have a sign
FAR = 0.1  # m
YIELDS = 1e-8  # of the softest direction
SLOPE = 1e-6  # of the largest entry
ROUGH = 1e-3  # differences of the oracle that are no better say nothing
LOOPS_ONLY = ("spinning rods", "four legs")
"""Spins that gravity turns, and a leg whose command is not unique: the oracle in loop coordinates takes the core's."""
TOGETHER = 20


def main() -> int:
    """Prints every machine that disagrees; exit code 1 if there is one."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--count", type=int, default=100)
    options.add_argument("--first", type=int, default=0)
    options.add_argument("--every", type=int, default=250, help="machines between two lines of progress")
    options.add_argument("--only", nargs="+", default=[], help="machines of these names among the seeds")
    options.add_argument("--jobs", type=int, default=1)
    options.add_argument("--out", type=Path, help="results, a line per machine")
    options.add_argument("--scheduler", help="address of a dask scheduler whose workers judge the machines")
    given = options.parse_args()
    done = (
        [json.loads(line) for line in given.out.read_text().splitlines()]
        if given.out and given.out.exists()
        else []
    )
    seeds = range(given.first, given.first + given.count)
    done = [r for r in done if r["seed"] in seeds]
    seen = {r["seed"] for r in done}
    todo = [s for s in seeds if s not in seen and (not given.only or name_of(s) in given.only)]
    for result in on_cluster(todo, given.scheduler) if given.scheduler else judged(todo, given.jobs):
        done.append(result)
        for wrong in result["wrong"]:
            print(f"seed {result['seed']}: {result['name']}: {wrong}", flush=True)
        if given.out:
            given.out.parent.mkdir(parents=True, exist_ok=True)
            with given.out.open("a") as out:
                out.write(json.dumps(result) + "\n")
        if len(done) % given.every == 0:
            print(summary(done), flush=True)
    print(summary(done), flush=True)
    return int(any(r["wrong"] for r in done))


def name_of(seed: int) -> str:
    return Generator(seed).machine().name if seed % 8 == 0 else Classes(seed).task().description.name


def judged(seeds: list[int], jobs: int) -> Iterator[dict[str, Any]]:
    """Results as they come. Where a process dies, its machines are judged one by one."""
    for first in range(0, len(seeds), TOGETHER * jobs):
        some = seeds[first : first + TOGETHER * jobs]
        with ProcessPoolExecutor(jobs, mp_context=get_context("fork")) as pool:
            try:
                results = list(pool.map(judge, some))
            except BrokenProcessPool:
                results = [alone(seed) for seed in some]
        yield from results


def on_cluster(seeds: list[int], scheduler: Any) -> Iterator[dict[str, Any]]:
    """Results of a cluster's workers as they come."""
    with workers(judge_for, None, scheduler=scheduler) as cluster:
        for _, result in cluster.as_done(seeds):
            yield result


def judge_for(_: None, seed: int) -> dict[str, Any]:
    """One machine, as a task."""
    return judge(seed)


def alone(seed: int) -> dict[str, Any]:
    with ProcessPoolExecutor(1, mp_context=get_context("fork")) as pool:
        try:
            return pool.submit(judge, seed).result()
        except BrokenProcessPool:
            return {
                "seed": seed,
                "name": name_of(seed),
                "states": {},
                "worst": {},
                "wrong": ["the program dies"],
                "cpu": 0,
            }


@on_one_thread
def judge(seed: int) -> dict[str, Any]:
    """One machine. On one thread of BLAS, as on a cluster: the last digits depend on it."""
    start = time.process_time()
    out: dict[str, Any] = {"seed": seed, "states": Counter(), "worst": {}, "wrong": []}
    try:
        if seed % 8 == 0:
            of_family(seed, out)
        else:
            of_class(seed, out)
    except Exception as error:  # an oracle that breaks off has proved nothing
        out["wrong"].append(f"{type(error).__name__}: {error}")
        out.setdefault("name", name_of(seed))
    return {**out, "cpu": round(time.process_time() - start, 3)}


def of_family(seed: int, out: dict[str, Any]) -> None:
    """By both oracles."""
    generator = Generator(seed)
    d = generator.machine()
    loads, pose = generator.loads(d), generator.pose(d)
    d = generator.declared(d)
    out["name"] = d.name
    for c in compare(seed):
        beyond = " beyond a bifurcation" if c.crossed else ""
        out["states"][f"{c.truth}{beyond}: {c.status.name}{' flagged' if c.told else ''}"] += 1
        wrong = objection(c)
        if wrong:
            out["wrong"].append(f"{wrong}: {c}")
        elif c.truth == "found" and not c.told:
            keep(out, {"loop coordinates": c.gap})
    if d.name not in LOOPS_ONLY:
        machine = sm.Machine(d)
        pose = pose if reached(machine, pose) else d.home
        kind = "semitangential" if loads.moment.any() else "dead"
        by_bodies(Task(d, pose, None, loads, kind, True), out, drives=False)


def of_class(seed: int, out: dict[str, Any]) -> None:
    """By bodies; a quarter with an effect, slopes of an eighth."""
    rng, task = np.random.default_rng((seed, 2)), Classes(seed).task()
    out["name"] = task.description.name
    if seed % 16 in (1, 6, 11, 15) and out["name"] != "few":
        task, out["effect"] = with_one_effect(task, rng)
    by_bodies(task, out)
    if seed % 16 in (3, 9) and out["name"] != "few":
        for s in slopes(task, rng):
            if s.noise < ROUGH:
                keep(out, {"slope": s.off})
                if not s.off < SLOPE + s.noise:
                    out["wrong"].append(f"slope {s}")


def by_bodies(task: Task, out: dict[str, Any], drives: bool = True) -> None:
    try:
        truth, found = checks(task)
    except Unsupported as error:
        out["states"][f"not for bodies: {error}"] += 1
        return
    for c in found:
        if not drives and "drives" in c.how:
            continue
        stable = "" if truth.stable or not truth.found else " unstable"
        out["states"][f"{c.truth}{stable}: {c.status}{' flagged' if c.flagged else ''}"] += 1
        if c.wrong:
            gaps = ", ".join(f"{k} {v:.0e}" for k, v in c.gaps.items())
            out["wrong"].append(
                f"{c.how}, {task.kind}, {out.get('effect', '')}: {c.status}: {c.wrong} ({gaps})"
            )
        elif not c.flagged:
            keep(out, c.gaps)


def keep(out: dict[str, Any], worst: dict[str, float]) -> None:
    for k, v in worst.items():
        out["worst"][k] = max(v, out["worst"].get(k, 0.0))


def summary(done: Iterable[dict[str, Any]]) -> str:
    states: Counter[str] = Counter()
    worst: dict[str, Any] = {"worst": {}}
    names: Counter[str] = Counter()
    bad: Counter[str] = Counter()
    cpu = 0.0
    for r in done:
        states.update(r["states"])
        keep(worst, r["worst"])
        names[r["name"]] += 1
        bad[r["name"]] += bool(r["wrong"])
        cpu += r["cpu"]
    table = ", ".join(
        f"{n} {c}" + (f" ({bad[n]} disagree)" if bad[n] else "") for n, c in sorted(names.items())
    )
    numbers = ", ".join(f"{k} {v:.0e}" for k, v in worst["worst"].items())
    return (
        f"{sum(names.values())} machines ({table}); {dict(states)}; worst {numbers}; "
        f"{sum(bad.values())} disagree; {cpu / max(1, sum(names.values())):.2f} s of CPU each"
    )


def agrees(c: Comparison) -> bool:
    """Nothing to object to."""
    return not objection(c)


def objection(c: Comparison) -> str:
    """What is wrong with an answer; empty: nothing.

    Numbers, flagged or not, are those of an equilibrium, CONVERGED if no eigenvalue is negative and UNSTABLE if
    one is. Without a flag it is the equilibrium at the end of the path from no load, on which the minimiser
    arrives too. No answer, or one that may be on another branch (flagged), is right where the path ends, beyond a
    bifurcation, or where the machine is deformed out of all proportion.
    """
    numbers = c.status in (Status.CONVERGED, Status.UNSTABLE)
    if numbers:
        if c.own is None or not c.own.off < OFF:
            return "not an equilibrium"
        if abs(c.own.lowest) > CRITICAL and (c.own.falling == 0) != (c.status == Status.CONVERGED):
            return "status against the eigenvalues at its own coordinates"
    elif c.own is not None:
        return "numbers without a status"
    if c.truth == "given up":
        return ""
    if c.truth == "singular":
        return "" if c.status == Status.SINGULAR else "singular, not said"
    if c.truth == "ends":
        return "" if c.told else "beyond the end of the path, not said"
    if c.told:
        return "" if c.crossed or c.moved > FAR else "not found, or not vouched for"
    if not numbers:
        return "no answer"
    if c.stable != (c.status == Status.CONVERGED):
        return "status against the eigenvalues"
    if c.flags & Flag.RIGID_DIRECTION and c.softness > YIELDS:
        return "a rigid direction that yields"
    return "" if c.gap < LIMIT else "another answer"


if __name__ == "__main__":
    sys.exit(main())
