"""Time of an error map against the time of its solves.

    python bench/map_share.py [machine] [--points 60]

One thread, its own processor time, the least of several rounds: `error_map` in memory with `plane=None`, and
`Machine.solve` on the same poses and wrenches, displacements alone, in blocks of the size that the map uses.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

import stiffmap as sm
from stiffmap.workspace.maps.block import POSES_AT_ONCE

ROUNDS = 7


def least(work: Callable[[], object]) -> float:
    """Processor time (s) of the fastest round."""
    best = np.inf
    for _ in range(ROUNDS):
        start = time.process_time()
        work()
        best = min(best, time.process_time() - start)
    return best


def main() -> None:
    """Prints both times and what the map adds."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("machine", nargs="?", default="orthoglide-revised")
    parser.add_argument("--points", type=int, default=60, help="poses along each axis")
    wanted = parser.parse_args()
    machine = sm.load_machine(wanted.machine)
    axes = [np.linspace(a, b, wanted.points) for a, b in zip(*machine.workspace, strict=True)]
    wrench = np.array([300.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    poses = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)

    def solves() -> None:
        for i in range(0, len(poses), POSES_AT_ONCE):
            machine.solve(poses[i : i + POSES_AT_ONCE], wrench, threads=1, stiffness=False)

    def whole() -> object:
        x, y, z = axes
        return sm.error_map(machine, x=x, y=y, z=z, wrench=wrench, plane=None, threads=1, progress=False)

    for work in (solves, whole):
        work()
    alone, mapped = least(solves), least(whole)
    each = 1e6 / len(poses)
    print(
        f"{wanted.machine}, {len(poses)} poses: solves {alone * each:.2f} µs a pose, map {mapped * each:.2f}"
    )
    print(f"the map adds {100 * (mapped / alone - 1):.1f} %")


if __name__ == "__main__":
    main()
