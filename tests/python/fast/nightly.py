"""A million solves on both paths: python tests/python/fast/nightly.py [--solves N] [--seed N] [--threads N]

Every shipped machine, every instruction-set level in turn, random poses and loads, a tenth of them zero. Exit code 1 on the first
batch whose statuses differ or whose numbers differ by more than the tolerance (agreement.py).
"""

from __future__ import annotations

import argparse
import os

from agreement import LOADS, TOLERANCE, compare, draw

import stiffmap as sm
from stiffmap import _core

BATCH = 2000


def main() -> int:
    """Runs until the number of solves is reached."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--solves", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=2)
    wanted = parser.parse_args()
    machines = [m for m in map(sm.load_machine, LOADS) if m.fast == ""]
    levels = _core.kernel_levels()
    done, worst, seed = 0, 0.0, wanted.seed
    while done < wanted.solves:
        machine, level = machines[seed % len(machines)], levels[seed // len(machines) % len(levels)]
        os.environ["STIFFMAP_ISA"] = level
        position, wrench = draw(machine, BATCH, seed)
        wrench[::10] = 0.0
        fast, reference = (
            machine.solve(position, wrench, method=m, threads=wanted.threads) for m in ("fast", "reference")
        )
        gap = compare(fast, reference)
        worst = max(worst, gap.worst())
        done += BATCH
        if gap.statuses or gap.worst() > TOLERANCE:
            print(f"{machine.name}, level {level}, seed {seed}: {gap}")
            return 1
        if seed % 50 == 0:
            print(f"{done} solves, largest difference {worst:.1e}", flush=True)
        seed += 1
    print(f"{done} solves, largest difference {worst:.1e}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
