"""Frequency responses of many poses, and a lobe diagram of 400 x 400: wall and processor time.

OPENBLAS_NUM_THREADS=1 python bench/vibration.py [--poses 10000]
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import stiffmap as sm
from stiffmap.machining.chatter.cut import milling_process, mode_rows, multiplier_map

MODES = ([(922, 0.011, 0.03993, "x")], [(922, 0.011, 0.03993, "x"), (922, 0.011, 0.03993, "y")])


def timed(label: str, work) -> None:  # type: ignore[no-untyped-def]
    """Print wall and processor seconds of a call."""
    wall, own = time.perf_counter(), time.process_time()
    work()
    print(
        f"{label:58s} {time.perf_counter() - wall:6.2f} s wall {time.process_time() - own:6.2f} s processor",
        flush=True,
    )


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--poses", type=int, default=10_000)
    parser.add_argument("--machines", default="ur10,orthoglide-revised,linear-delta,hexapod")
    given = parser.parse_args()
    rng = np.random.default_rng(0)
    f = np.linspace(1, 200, 200)
    for name in given.machines.split(","):
        machine = sm.load_machine(name)
        p = rng.uniform(*machine.workspace, (given.poses, 3))
        for modes in (8, None):
            timed(
                f"{name}: {given.poses} poses x 200 frequencies, {modes or 'all'} modes",
                lambda m=machine, p=p, k=modes: sm.frequency_response(m, p, f, modes=k),
            )
    process = milling_process("slot")
    speed, depth = np.linspace(5000, 25000, 400) * np.pi / 30, np.linspace(1e-5, 4e-3, 400)
    for rows in MODES:
        timed(
            f"lobes 400 x 400, {len(rows)} modes, 40 intervals",
            lambda r=rows: multiplier_map(mode_rows(r), process, speed, depth, 40),
        )


if __name__ == "__main__":
    main()
