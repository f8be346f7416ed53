"""Machines that nobody shipped, as cases of every_machine.py: those of the nightly oracle, by their seeds, and the hand-made
ones of further classes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from tests.oracle.classes import Classes
from tests.oracle.generate import Generator
from tests.oracle.unseen import UNSEEN

import stiffmap as sm
from stiffmap.model.description import Block, Joint

GRAVITY = (0.0, 0.0, -9.81)
FORCE = 230.0  # N, as that of the shipped machines
MOST_FAILED = 0.05  # share of poses without a stable answer under a load that a machine is said to bear
EDGES = (0.1, 0.03, 0.01)  # m, half of the box about home
POSES = 1024
Solve = Callable[[np.ndarray], sm.Solution]


@dataclass(frozen=True)
class Case:
    """A machine, and drives (actuators,) m or rad by which it is commanded, where it cannot be by poses."""

    family: str
    name: str
    machine: sm.Machine
    drives: np.ndarray | None = None


def machines(count: int) -> Iterator[Case]:
    """The oracle's by seed, families of its generator and further classes in turn; then all hand-made machines."""
    for seed in range(count):
        yield of_seed(seed)
    for name, make in UNSEEN.items():
        yield Case(name, name, sm.Machine(make()))


def of_seed(seed: int) -> Case:
    """Even seeds are the generator's, odd ones those of the further classes."""
    if seed % 2 == 0:
        description = Generator(seed).machine()
        return Case(description.name, f"{description.name} {seed}", boxed(sm.Machine(description)))
    task = Classes(seed).task()
    d, machine = task.description, sm.Machine(task.description)
    if task.by_pose:
        return Case(d.name, f"{d.name} {seed}", boxed(machine))
    if task.drives is None:  # no joints, or fewer than would reach a pose beside home
        home = replace(d, workspace=(d.home.translation, d.home.translation))
        return Case(d.name, f"{d.name} {seed}", sm.Machine(home))
    drives = np.array([task.drives[name] for name in machine.actuators])
    return Case(d.name, f"{d.name} {seed}", machine, drives)


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


def columns(case: Case) -> Iterator[tuple[str, Solve, np.ndarray]]:
    """Name, what is called on rows of numbers, and these: unloaded; loads of one size in random directions; the same under
    gravity; nearly as much as the machine bears; an arm by its joints."""
    machine, rng = case.machine, np.random.default_rng(1)
    w = np.zeros((POSES, 6))
    w[:, :3] = rng.normal(size=(POSES, 3))
    w[:, :3] /= np.linalg.norm(w[:, :3], axis=1)[:, None]
    arm = len(machine.legs) == 1 and not machine.free_spins and not any_blocks(machine)
    by_joints = case.drives is not None
    if case.drives is not None:
        width = 0.3 if arm else 0.0
        p = case.drives + rng.uniform(-width, width, (POSES, len(machine.actuators)))
    else:
        p = rng.uniform(*machine.workspace, (POSES, 3))
    solve, n = (machine.solve_joints if by_joints else machine.solve), p.shape[1]

    def at(size: float, **options: object) -> Solve:
        return lambda rows: solve(rows[:, :n], size * rows[:, n:], threads=1, **options)  # type: ignore[arg-type]

    rows, few = np.hstack([p, w]), np.hstack([p, w])[:24]
    name = "joints, {}" if by_joints else "{}"
    borne = level(lambda size: at(size)(few), FORCE, machine.compiled.length)
    yield name.format("unloaded"), lambda rows: solve(rows[:, :n], threads=1), rows
    yield name.format("loaded"), at(min(borne, FORCE)), rows
    heavy = level(lambda size: at(size, gravity=GRAVITY)(few), FORCE, machine.compiled.length, most=FORCE)
    yield name.format("gravity"), at(heavy, gravity=GRAVITY), rows
    if borne > FORCE:
        yield name.format("far"), at(borne), rows
    if arm and not by_joints and machine.actuators:
        home = sm.inverse_kinematics(machine, machine.description.home.p).actuators
        turned = home + rng.uniform(-0.3, 0.3, (POSES, len(home)))
        yield "joints, unloaded", lambda q: machine.solve_joints(q, threads=1), turned
        force = min(borne, FORCE) * w[0]
        yield "joints, loaded", lambda q: machine.solve_joints(q, force, threads=1), turned


def any_blocks(machine: sm.Machine) -> bool:
    """Whether some chain has branches, or a joint without a drive."""
    d = machine.description
    elements = [e for leg in d.legs for e in leg.elements] + [*d.base, *d.platform]
    return any(isinstance(e, Block) or (isinstance(e, Joint) and not e.actuated) for e in elements)


def level(solve: Callable[[float], sm.Solution], start: float, length: float, most: float = 1e7) -> float:
    """A force (N) that nearly all poses bear, no tip moving further than three times `length` (m), of which the double
    they do not; at most `most`."""

    def bears(size: float) -> bool:
        s = solve(size)
        moved = np.linalg.norm(s.displacement[s.ok, :3], axis=1)
        return bool((s.status == sm.Status.CONVERGED).mean() > 1 - MOST_FAILED and np.all(moved < 3 * length))

    size = start
    while size > 1e-2 * start and not bears(size):
        size /= 4
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
