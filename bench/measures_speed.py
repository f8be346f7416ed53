"""Time of the full table of measures: `python bench/measures_speed.py [MACHINE ...] [--rounds 3] [--threads 2]`.

Of the Orthoglide against `trimming` as §5.1 asks, of other machines without requirements; 51³ poses, box bounds 0.1 mm.
"""

from __future__ import annotations

import argparse
import time

import stiffmap as sm

ALL = ("orthoglide-revised", "linear-delta", "hexapod", "ur10")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("machines", nargs="*", default=ALL)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--threads", type=int, default=None)
    given = parser.parse_args()
    for name in given.machines:
        task = "trimming" if name.startswith("orthoglide") else None
        told = []
        for _ in range(given.rounds):
            wall, cpu = time.perf_counter(), time.process_time()
            sm.measures(sm.load_machine(name), requirements=task, threads=given.threads)
            told.append(
                f"{time.perf_counter() - wall:.1f} s ({time.process_time() - cpu:.1f} s of processor time)"
            )
        print(f"{name}: {', '.join(told)}", flush=True)


if __name__ == "__main__":
    main()
