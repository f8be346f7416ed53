"""How long a diagnosis takes where nothing explains the readings.

    OPENBLAS_NUM_THREADS=1 python bench/odd_sets.py --machine linear-delta --quantity deflection --rows 540

Deflections get a tool with couplings in all directions that changes over the workspace, positions get waves; neither is
an effect of the library. Prints CPU seconds of all threads, the verdict, and what was not tried.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

import stiffmap as sm
from stiffmap.experiment import Experiment, random_plan, simulate

MACHINES = ("orthoglide-revised", "linear-delta", "rotary-delta", "ur10", "travelling-column")


def odd(machine: sm.Machine, quantity: str, rows: int) -> Experiment:
    """Readings of the declared machine, and what no effect explains."""
    deflection = quantity == "deflection"
    poses = max(rows // 12, 2) if deflection else rows // 2
    plan = random_plan(machine, quantity, poses=poses, loads=6, repeats=2, seed=1)
    if not deflection:
        plan = replace(plan, frame="unknown", tool="unknown" if machine.name == "ur10" else "known")
    twin = simulate(machine, plan, [], seed=3)
    reading = twin.reading.copy()
    x = (twin.position - twin.position.mean(0)) / np.maximum(np.ptp(twin.position, axis=0), 1e-9)
    if deflection:
        c = np.random.default_rng(5).standard_normal((6, 6))
        more = (twin.wrench / np.abs(twin.wrench).max()) @ (c @ c.T)
        more *= 0.5 * np.nanmedian(np.abs(reading[:, :3])) / np.abs(more).max()
        reading[:, :6] += more * (1.0 + x[:, [0]] * x[:, [1]])
    else:
        for a in range(3):
            reading[:, a] += 2e-4 * np.sin(7 * x[:, a] + 5 * x[:, (a + 1) % 3] ** 2 + a)
    return replace(twin, reading=np.where(twin.read, reading, np.nan), joints=None, other_joints=None)


def main() -> None:
    """One line per machine and quantity."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--machine", action="append", choices=MACHINES)
    parser.add_argument("--quantity", action="append", choices=("deflection", "position"))
    parser.add_argument("--rows", type=int, default=540)
    o = parser.parse_args()
    for name in o.machine or MACHINES:
        for quantity in o.quantity or ("deflection", "position"):
            machine = sm.load_machine(name)
            data = odd(machine, quantity, o.rows)
            begun = time.process_time()
            d = sm.diagnose(machine, data, seed=0)
            named = [f"{e.kind} of {e.element}" for e in d.effects]
            took = time.process_time() - begun
            print(
                f"{name} {quantity}: {took:.1f} s, {d.verdict} {named}, {len(d.not_tried)} steps not tried",
                flush=True,
            )


if __name__ == "__main__":
    main()
