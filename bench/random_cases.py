"""Machines that nobody shipped, as cases of every_machine.py: those of the nightly oracle's generator, by their seeds, and the
hand-made ones of further classes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import numpy as np
from tests.python.oracle.generate import Generator
from tests.python.oracle.unseen import UNSEEN

import stiffmap as sm

GRAVITY = (0.0, 0.0, -9.81)
FORCE = 230.0  # N, as that of the shipped machines
MOST_FAILED = 0.05  # share of poses without a stable answer under a load that a machine is said to bear
EDGES = (0.1, 0.03, 0.01)  # m, half of the box about home
POSES = 1024
Solve = Callable[[np.ndarray], sm.Solution]


def machines(count: int) -> Iterator[tuple[str, str, sm.Machine]]:
    """Family, name and machine: all hand-made ones, then the generator's by seed."""
    for name, make in UNSEEN.items():
        yield name, name, sm.Machine(make())
    for seed in range(count):
        description = Generator(seed).machine()
        yield description.name, f"{description.name} {seed}", boxed(sm.Machine(description))


def boxed(machine: sm.Machine) -> sm.Machine:
    """With the largest cube about home of `EDGES` in which nearly every pose closes; else home alone."""
    d = machine.description
    if d.workspace is not None:
        return machine
    for edge in (*EDGES, 0.0):
        low, high = d.home.p - edge, d.home.p + edge
        box = (tuple(low.tolist()), tuple(high.tolist()))
        p = np.random.default_rng(0).uniform(low, high, (32, 3))
        closed = machine.solve(p, gravity=(0, 0, 0), stiffness=False, threads=1)
        if edge == 0 or (closed.status != sm.Status.UNREACHABLE).mean() > 1 - MOST_FAILED:
            return sm.Machine(replace(d, workspace=box))
    raise AssertionError


def columns(machine: sm.Machine) -> Iterator[tuple[str, Solve, np.ndarray]]:
    """Name, what is called on rows of `poses`, and these: unloaded; loads of one size in random directions; the same under
    gravity; nearly as much as the machine bears; an arm by its joints."""
    rng = np.random.default_rng(1)
    p = rng.uniform(*machine.workspace, (POSES, 3))
    w = np.zeros((POSES, 6))
    w[:, :3] = rng.normal(size=(POSES, 3))
    w[:, :3] /= np.linalg.norm(w[:, :3], axis=1)[:, None]

    def at(size: float, **options: object) -> Solve:
        return lambda rows: machine.solve(rows[:, :3], size * rows[:, 3:], threads=1, **options)  # type: ignore[arg-type]

    rows, few = np.hstack([p, w]), np.hstack([p, w])[:64]
    borne = level(lambda size: at(size)(few), FORCE, machine.compiled.length)
    yield "unloaded", lambda rows: machine.solve(rows[:, :3], threads=1), rows
    yield "loaded", at(min(borne, FORCE)), rows
    heavy = level(lambda size: at(size, gravity=GRAVITY)(few), FORCE, machine.compiled.length, most=FORCE)
    yield "gravity", at(heavy, gravity=GRAVITY), rows
    if borne > FORCE:
        yield "far", at(borne), rows
    if len(machine.legs) == 1 and len(machine.compiled.names.coordinates) == len(machine.actuators):
        home = sm.inverse_kinematics(machine, machine.description.home.p).actuators
        turned = home + rng.uniform(-0.3, 0.3, (POSES, len(home)))
        yield "joints", lambda q: machine.solve_joints(q, threads=1), turned
        force = min(borne, FORCE) * w[0]
        yield "joints, loaded", lambda q: machine.solve_joints(q, force, threads=1), turned


def level(solve: Callable[[float], sm.Solution], start: float, length: float, most: float = 1e7) -> float:
    """A force (N) that nearly all poses bear, no tip moving further than `length` (m), of which the double they do not; at most `most`."""

    def bears(size: float) -> bool:
        s = solve(size)
        moved = np.linalg.norm(s.displacement[s.ok, :3], axis=1)
        return bool((s.status == sm.Status.CONVERGED).mean() > 1 - MOST_FAILED and np.all(moved < length))

    size = start
    while size > 1e-3 * start and not bears(size):
        size /= 2
    while size < most and bears(2 * size):
        size *= 2
    return min(size, most)


def summary(table: Mapping[tuple[str, str, str], tuple[float, float]], limit: float) -> Iterator[str]:
    """Lines of a table: of each family and column the cases, the share within the limit, the worst, and the largest share of
    poses that took the reference path; all together first."""
    rows: dict[tuple[str, str], list[tuple[float, float]]] = defaultdict(list)
    for (family, _, column), case in table.items():
        for key in (("all", "all"), ("all", column), (family, column)):
            rows[key].append(case)
    yield f"| machines | column | cases | within {limit:g} | worst | mean | reference path |"
    yield "|---|---|---|---|---|---|---|"
    for (family, column), found in sorted(rows.items(), key=lambda kv: (kv[0][0] != "all", kv[0])):
        multiples, shares = np.array(found).T
        yield (
            f"| {family} | {column} | {len(found)} | {100 * (multiples <= limit).mean():.1f} % | {multiples.max():.1f} | "
            f"{multiples.mean():.1f} | {100 * shares.mean():.2g} % |"
        )
