"""Agreement of the kernels with the reference path on random solves: every machine, effect and instruction-set level.

    python bench/both_paths.py [--count 1000000] [--minutes 60] [--state both_paths.json] [--threads 2]

Rounds over all shipped machines, each plain and with each kind of effect on every element that takes it
(effect_cases.py): random poses of the workspace box, random loads, every tenth pose without load, every other round
under gravity, two rounds each with dead, follower and semitangential loads; then ten rounds on the same machines with
more points: other readings, several loads of several types (`several`). The reference solves each pose once; each level's answer is compared with it and counts as one solve.
Statuses must be equal, displacement and loaded compliance within 1e-10 (tests/python/solve/compiled/agreement.py). The state
file is written after each case: the command goes on where it was stopped. Exit code 1 where something disagrees;
each such case is printed with what repeats it.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np
from effect_cases import machines_with_effects
from tests.python.solve.compiled.agreement import (
    LOADS,
    TOLERANCE,
    compare,
    draw,
    pointed,
    reading_gap,
    several,
)

import stiffmap as sm
from stiffmap import _core

POSES = 16
GRAVITY = (0.0, 0.0, -9.81)
KINDS = ("dead", "follower", "semitangential", *range(5))


def cases() -> list[tuple[str, str, sm.Machine]]:
    """Machine, effect and the machine with it; only those that the kernels take."""
    out = []
    for name in LOADS:
        machine = sm.load_machine(name)
        out += [(name, kind, m) for kind, m in (("none", machine), *machines_with_effects(machine))]
    return [c for c in out if c[2].fast == ""]


def one(
    machine: sm.Machine, seed: int, heavy: bool, kind: str | int, threads: int
) -> dict[str, tuple[int, float]]:
    """Wrong statuses and largest difference of each level."""
    position, wrench = draw(machine, POSES, seed)
    wrench[::10] = 0.0
    options: dict[str, object] = {"threads": threads, **({"gravity": GRAVITY} if heavy else {})}
    if isinstance(kind, int):
        machine = pointed(machine)
        wrench /= (1, 1, 2, 3, 3)[kind]  # together they are as large as one
        options |= several(wrench, kind, machine)
    else:
        options["load_type"] = kind
    reference = machine.solve(position, wrench, method="reference", **options)
    out = {}
    for level in _core.kernel_levels():
        os.environ["STIFFMAP_ISA"] = level
        answer = machine.solve(position, wrench, **options)
        gap = compare(answer, reference)
        worst = max(gap.worst(), reading_gap(answer, reference))
        out[level] = (gap.statuses, float(np.nan_to_num(worst, nan=np.inf)))
    os.environ.pop("STIFFMAP_ISA", None)
    return out


def main() -> int:
    """Runs until the count or the time is reached."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=1_000_000)
    parser.add_argument("--minutes", type=float, default=1e9)
    parser.add_argument("--state", type=Path, default=Path("both_paths.json"))
    parser.add_argument("--threads", type=int, default=2)
    wanted = parser.parse_args()
    state = {"next": 0, "solves": 0, "worst": {}, "failed": []}
    if wanted.state.exists():
        state = json.loads(wanted.state.read_text())
    every, end = cases(), time.monotonic() + 60 * wanted.minutes
    print(f"{len(every)} cases, from number {state['next']}", flush=True)
    while state["solves"] < wanted.count and time.monotonic() < end:
        lap, index = divmod(state["next"], len(every))
        name, kind, machine = every[index]
        heavy, loads = lap % 2 == 1, KINDS[lap // 2 % len(KINDS)]
        for level, (statuses, worst) in one(machine, state["next"], heavy, loads, wanted.threads).items():
            state["solves"] += POSES
            key = f"{name} {kind}"
            state["worst"][key] = max(state["worst"].get(key, 0.0), worst)
            if statuses or worst > TOLERANCE:
                found = [name, kind, level, state["next"], heavy, loads, statuses, worst]
                state["failed"].append(found)
                print("disagreement:", *found, flush=True)
        state["next"] += 1
        wanted.state.write_text(json.dumps(state))
        if index == len(every) - 1:
            print(f"lap {lap}: {state['solves']} solves, {max(state['worst'].values()):.1e}", flush=True)
    worst = sorted(state["worst"].items(), key=lambda kv: -kv[1])[:10]
    print(f"{state['solves']} solves of {len(every)} cases, {len(state['failed'])} disagreements; largest:")
    for key, value in worst:
        print(f"  {value:.1e} {key}")
    return 1 if state["failed"] else 0


if __name__ == "__main__":
    sys.exit(main())
