from __future__ import annotations

import os
from collections.abc import Callable
from statistics import median
from timeit import timeit
from typing import Any, NamedTuple

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.solve.compiled import kernel_levels
from stiffmap.solve.machine import Machine, load_machine
from stiffmap.ui.cli.options import how_many
from stiffmap.ui.cli.output import Answer, table

MACHINES = ("tripteron", "orthoglide-revised")
FORCE = 300.0  # N, along z
GRID, REFERENCE_GRID, MANY = 14, 4, 40  # poses along each side of the workspace


class BenchCase(NamedTuple):
    """One measured case: median of the rounds, microseconds per pose or a ratio."""

    case: str
    value: float
    unit: str


def command(
    rounds: int = how_many("Measurements of each case; the median is shown.", 7),
) -> Answer:
    """Speed of this installation on this computer, in less than a minute.

    Times per pose with all answers (displacement, stiffness, efforts, leg wrenches) on one thread, cases in
    turn. Close other programs first. The environment variable STIFFMAP_ISA chooses the instruction set.

    Examples:
      [cyan]stiffmap bench[/cyan]
      [cyan]STIFFMAP_ISA=base stiffmap bench --json[/cyan]
    """
    if rounds < 1:
        raise StiffmapError(f"rounds: expected a positive number, got {rounds}")
    level = os.environ.get("STIFFMAP_ISA") or kernel_levels()[-1]
    lines = [line for name in MACHINES for line in machine_lines(load_machine(name), rounds)]
    lines += thread_lines(load_machine(MACHINES[1]), rounds)
    title = f"instruction set {level}, median of {rounds}"
    words = [(line.case, f"{line.value:.3g}", line.unit) for line in lines]
    data = {"instruction_set": level, "rounds": rounds, "cases": [line._asdict() for line in lines]}
    return Answer(data, [table(title, ("case", "value", "unit"), words, left=("case", "unit"))])


def machine_lines(machine: Machine, rounds: int) -> list[BenchCase]:
    """Unloaded, loaded, reference path and a call on one pose."""
    wrench = np.array([0, 0, FORCE, 0, 0, 0])
    many, few, one = grid(machine, GRID), grid(machine, REFERENCE_GRID), grid(machine, 1)
    t = in_turn(
        rounds,
        unloaded=lambda: machine.solve(many, threads=1),
        loaded=lambda: machine.solve(many, wrench, threads=1),
        reference=lambda: machine.solve(few, wrench, method="reference", threads=1),
        one=lambda: machine.solve(one, threads=1),
    )
    loaded, reference = t["loaded"] / len(many), t["reference"] / len(few)
    return [
        BenchCase(f"{machine.name}, stiffness without load", 1e6 * t["unloaded"] / len(many), "µs/pose"),
        BenchCase(f"{machine.name}, equilibrium and stiffness at {FORCE:g} N", 1e6 * loaded, "µs/pose"),
        BenchCase(f"{machine.name}, the same by the reference path", 1e6 * reference, "µs/pose"),
        BenchCase(f"{machine.name}, reference path / fast path", reference / loaded, "times"),
        BenchCase(f"{machine.name}, one call on one pose", 1e6 * t["one"], "µs"),
    ]


def thread_lines(machine: Machine, rounds: int) -> list[BenchCase]:
    """All cores against one."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    poses, wrench = grid(machine, MANY), np.array([0, 0, FORCE, 0, 0, 0])
    t = in_turn(
        rounds,
        one=lambda: machine.solve(poses, wrench, threads=1),
        all=lambda: machine.solve(poses, wrench, threads=cores),
    )
    return [BenchCase(f"{machine.name}, {cores} threads against one", t["one"] / t["all"], "times")]


def grid(machine: Machine, n: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    """(n^3, 3) m: 1/18 of the workspace away from its faces."""
    low, high = machine.workspace
    share = np.linspace(1 / 18, 17 / 18, n) if n > 1 else np.array([0.5])
    s = np.stack(np.meshgrid(share, share, share, indexing="ij"), -1).reshape(-1, 3)
    return np.asarray(low + s * (high - low))


def in_turn(rounds: int, **works: Callable[[], object]) -> dict[str, float]:
    """Median seconds of each work; all of them once per round, so that a disturbance meets them all."""
    times: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(1 + rounds):  # the first one warms up
        for name, work in works.items():
            times[name].append(timeit(work, number=1))
    return {name: median(t[1:]) for name, t in times.items()}
