"""Thousands of random machines against energy minimisation.

usage: python -m tests.python.oracle.nightly --count 1000 [--first 0]
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter

from stiffmap import Flag, Status

from .compare import Comparison, compare

LIMIT = 1e-8
FAR = 0.1  # m


def main() -> int:
    """Prints every machine that disagrees; exit code 1 if there is one."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--count", type=int, default=100)
    options.add_argument("--first", type=int, default=0)
    options.add_argument("--every", type=int, default=250, help="machines between two lines of progress")
    given = options.parse_args()
    states: Counter[str] = Counter()
    bad, worst = 0, 0.0
    for done, seed in enumerate(range(given.first, given.first + given.count), 1):
        for c in compare(seed):
            told = " flagged" if c.flags & Flag.BRANCH_UNVERIFIED else ""
            states[f"{c.truth}{' beyond a bifurcation' if c.crossed else ''}: {c.status.name}{told}"] += 1
            if c.truth == "found" and agrees(c):
                worst = max(worst, c.gap)
            if not agrees(c):
                bad += 1
                print(f"seed {seed}: {c}", flush=True)
        if done % given.every == 0 or done == given.count:
            print(
                f"{done} machines by both paths, {dict(states)}, worst {worst:.1e}, {bad} disagree",
                flush=True,
            )
    return int(bad > 0)


def agrees(c: Comparison) -> bool:
    """Same equilibrium, same compliance, and a status that agrees with the eigenvalues of the reduced Hessian;
    singular for both; or the path of loads ends for both (the core may find an equilibrium beyond the end, or
    on another branch, if it says so). Nothing is asked where the oracle gave up."""
    if c.truth == "given up":
        return True
    if c.truth == "singular":
        return c.status == Status.SINGULAR
    unverified = c.status == Status.NOT_CONVERGED or bool(c.flags & Flag.BRANCH_UNVERIFIED)
    if c.truth == "ends":
        return unverified
    if unverified and (c.crossed or c.moved > FAR):
        return True  # beyond a bifurcation, or deformed out of all proportion: refused, or flagged
    found = c.status in (Status.CONVERGED, Status.UNSTABLE)
    return found and c.gap < LIMIT and c.stable == (c.status == Status.CONVERGED)


if __name__ == "__main__":
    sys.exit(main())
