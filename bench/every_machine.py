"""Cost of a pose on every shipped machine, per coordinate, in multiples of the unloaded Orthoglide.

    python bench/every_machine.py [machine ...] [--effects] [--seconds 0.2] [--json table.json]

One thread, its own processor time (so other work on the machine hardly shows), the least of several rounds. A case
is a batch of random poses in the workspace box of the machine file:

    unloaded   no wrench
    loaded     F = 100, 50, -200 N
    gravity    the same force and gravity
    outside    the same force, a third of the poses beyond the box (up to half its size)
    beyond     the same force at the poses of `outside` that are out of reach

--effects adds a row per machine and effect of its drives, links and joints, under the same force. Behind each
multiple stands the share of poses that took the reference path, in percent. Coordinates are spring directions plus
joint axes. Exit code 1 where a number of the table is above its limit: 4, outside the box 10, the share 0.1 %.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

import stiffmap as sm
from stiffmap.files import shipped_machines

FORCE = np.array([100.0, 50.0, -200.0, 0.0, 0.0, 0.0])
GRAVITY = (0.0, 0.0, -9.81)
BASE = "orthoglide-revised"
POSES = 4096
MOST, MOST_OUTSIDE, MOST_SHARE = 4.0, 10.0, 1e-3
COLUMNS = ("unloaded", "loaded", "gravity", "outside", "beyond")
EFFECTS: tuple[tuple[str, dict[str, object]], ...] = (
    ("dead_zone", {"half_width": 5e-6}),
    ("friction", {"force": 5.0, "branch": "loading"}),
    ("hardening", {"cubic": 1e13}),
    ("length", {"error": 2e-5}),
    ("tilt", {"angle_x": 5e-4, "angle_y": -3e-4}),
    ("straightness", {"amplitude": 1e-5, "period": 0.4, "phase": 0.5}),
    ("joint_friction", {"torque": 0.1, "branch": "loading"}),
    ("joint_compliance", {"translation": 1e-9, "rotation": 1e-7}),
)


def inside(machine: sm.Machine, n: int) -> np.ndarray:
    """Positions (n, 3) m in the workspace box."""
    low, high = machine.workspace
    return np.random.default_rng(1).uniform(low, high, (n, 3))


def outside(machine: sm.Machine, n: int) -> np.ndarray:
    """The same, but every third beyond the box."""
    rng = np.random.default_rng(2)
    low, high = machine.workspace
    out = inside(machine, n)
    middle, half = (low + high) / 2, (high - low) / 2
    for i in range(0, n, 3):
        u = rng.uniform(-2, 2, 3)
        while np.abs(u).max() < 1:
            u = rng.uniform(-2, 2, 3)
        out[i] = middle + u * half
    return out


def cost(
    solve: Callable[[np.ndarray], sm.Solution], poses: np.ndarray, seconds: float
) -> tuple[float, sm.Solution]:
    """Least seconds per pose, and the answer; fewer poses where one is dear."""
    n = min(24, len(poses))
    solve(poses[:2])
    start = time.process_time()
    answer = solve(poses[:n])
    each = (time.process_time() - start) / n
    few = poses[: max(24, min(len(poses), int(seconds / max(each, 1e-7))))]
    best, spent, rounds = np.inf, 0.0, 0
    while rounds < 2 or (spent < seconds and rounds < 7):
        start = time.process_time()
        answer = solve(few)
        took = time.process_time() - start
        best, spent, rounds = min(best, took / len(few)), spent + took, rounds + 1
        if spent > 5 * seconds:
            break
    return best, answer


def share(answer: sm.Solution) -> float:
    """Share of poses that took the reference path."""
    return float((answer.flags & sm.Flag.REFERENCE_PATH != 0).mean())


Case = tuple[str, Callable[[np.ndarray], sm.Solution], np.ndarray]


def cases(machine: sm.Machine) -> Iterator[Case]:
    """Columns of the table."""

    def solve(**options: object) -> Callable[[np.ndarray], sm.Solution]:
        return lambda p: machine.solve(p, threads=1, **options)  # type: ignore[arg-type]

    poses, wide = inside(machine, POSES), outside(machine, POSES)
    yield "unloaded", solve(), poses
    yield "loaded", solve(wrench=FORCE), poses
    yield "gravity", solve(wrench=FORCE, gravity=GRAVITY), poses
    yield "outside", solve(wrench=FORCE), wide
    far = machine.solve(wide[::3][:256], threads=1, stiffness=False).status == sm.Status.UNREACHABLE
    if far.sum() > 8:
        yield "beyond", solve(wrench=FORCE), np.resize(wide[::3][:256][far], (512, 3))


def element_names(elements: Iterable[Any]) -> Iterator[str]:
    """Names of a chain's elements, with those inside its blocks."""
    for e in elements:
        if hasattr(e, "branches"):
            for branch in e.branches:
                yield from element_names(branch.elements if hasattr(branch, "elements") else branch[1])
        else:
            yield e.name


def effect_cases(machine: sm.Machine) -> Iterator[Case]:
    """One case for each effect that some element of the machine takes; all of its elements have it."""
    names = {n for leg in machine.description.legs for n in element_names(leg.elements)}
    for kind, values in EFFECTS:
        changed, found = machine, 0
        for name in sorted(names):
            try:
                changed, found = changed.with_effect(kind, element=name, **values), found + 1  # type: ignore[arg-type]
            except sm.StiffmapError:
                continue
        if found:
            yield kind, (lambda p, m=changed: m.solve(p, FORCE, threads=1)), inside(machine, POSES)


def main() -> int:
    """Prints the table; 1 where a number is above its limit."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("machines", nargs="*")
    parser.add_argument("--effects", action="store_true")
    parser.add_argument("--seconds", type=float, default=0.2)
    parser.add_argument("--json", type=Path)
    wanted = parser.parse_args()
    base = sm.load_machine(BASE)
    unit = cost(lambda p: base.solve(p, threads=1), inside(base, POSES), wanted.seconds)[0]
    unit /= len(base.compiled.names.coordinates)
    print(f"unit: {1e9 * unit:.1f} ns per coordinate, {BASE} unloaded\n", flush=True)
    table: dict[str, dict[str, list[float]]] = {}
    late = 0
    print(f"| machine | {' | '.join(COLUMNS)} |\n|---|{'---|' * len(COLUMNS)}")
    for name in wanted.machines or [m.name for m in shipped_machines()]:
        machine = sm.load_machine(name)
        row = table[name] = {}
        n = len(machine.compiled.names.coordinates)
        for column, solve, poses in (*cases(machine), *(effect_cases(machine) if wanted.effects else ())):
            seconds, answer = cost(solve, poses, wanted.seconds)
            row[column] = [seconds / n / unit, share(answer), 1e6 * seconds]
            wide = column in ("outside", "beyond")
            late += row[column][0] > (MOST_OUTSIDE if wide else MOST) or (
                not wide and row[column][1] > MOST_SHARE
            )
        cells = [f"{row[c][0]:.1f} ({100 * row[c][1]:.2g} %)" if c in row else "–" for c in COLUMNS]
        print(f"| {name} | {' | '.join(cells)} |", flush=True)
        for column in row:
            if column not in COLUMNS:
                print(
                    f"|   {column} | – | {row[column][0]:.1f} ({100 * row[column][1]:.2g} %) | | | |",
                    flush=True,
                )
    if wanted.json:
        wanted.json.write_text(json.dumps(table, indent=1))
    print(f"\n{late} of {sum(map(len, table.values()))} numbers above their limit")
    return 1 if late else 0


if __name__ == "__main__":
    sys.exit(main())
