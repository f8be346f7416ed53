"""Thousands of random machines against energy minimisation.

usage: python -m tests.python.oracle.nightly --count 1000 [--first 0]
"""

from __future__ import annotations

import argparse
import sys

from .compare import compare

LIMIT = 1e-8


def main() -> int:
    """Prints every machine that disagrees; exit code 1 if there is one."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--count", type=int, default=100)
    options.add_argument("--first", type=int, default=0)
    given = options.parse_args()
    bad, worst = 0, 0.0
    states: dict[str, int] = {}
    for seed in range(given.first, given.first + given.count):
        for c in compare(seed):
            states[c.status.name] = states.get(c.status.name, 0) + 1
            if c.status:
                continue
            gap = max(c.translation, c.rotation, c.compliance)
            worst = max(worst, gap)
            if not gap < LIMIT:
                bad += 1
                print(f"seed {seed}: {c}")
    print(f"{given.count} machines by both paths, {states}, worst {worst:.1e}, {bad} beyond {LIMIT:.0e}")
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
