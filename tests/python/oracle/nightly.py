"""Thousands of random machines against energy minimisation: numbers, and every status against the eigenvalues of the
energy's Hessian over the motions that keep the loops closed.

usage: python -m tests.python.oracle.nightly --count 1000 [--first 0] [--only "spinning rods"]
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Sequence

from stiffmap import Flag, Status

from .compare import Comparison, compare
from .generate import Generator

LIMIT = 1e-8
OFF = 1e-8  # m, rad: from the core's coordinates to the equilibrium
CRITICAL = 1e-9  # lowest eigenvalue over the largest: too small to have a sign
FAR = 0.1  # m
YIELDS = 1e-8  # of the softest direction


def main() -> int:
    """Prints every machine that disagrees; exit code 1 if there is one."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--count", type=int, default=100)
    options.add_argument("--first", type=int, default=0)
    options.add_argument("--every", type=int, default=250, help="machines between two lines of progress")
    options.add_argument("--only", default="", help="machines of this name among the seeds")
    given = options.parse_args()
    seeds: Sequence[int] = range(given.first, given.first + given.count)
    if given.only:
        seeds = [seed for seed in seeds if Generator(seed).machine().name == given.only]
    states: Counter[str] = Counter()
    bad, worst = 0, 0.0
    for done, seed in enumerate(seeds, 1):
        for c in compare(seed):
            states[
                f"{c.truth}{' beyond a bifurcation' if c.crossed else ''}: {c.status.name}"
                f"{' flagged' if c.told else ''}"
            ] += 1
            wrong = objection(c)
            if wrong:
                bad += 1
                print(f"seed {seed}: {wrong}: {c}", flush=True)
            elif c.truth == "found" and not c.told:
                worst = max(worst, c.gap)
        if done % given.every == 0 or done == len(seeds):
            print(
                f"{done} machines by both paths, {dict(states)}, worst {worst:.1e}, {bad} disagree",
                flush=True,
            )
    return int(bad > 0)


def agrees(c: Comparison) -> bool:
    """Nothing to object to."""
    return not objection(c)


def objection(c: Comparison) -> str:
    """What is wrong with an answer; empty: nothing.

    Numbers, flagged or not, are those of an equilibrium, CONVERGED if no eigenvalue is negative and UNSTABLE if
    one is. Without a flag it is the equilibrium at the end of the path from no load, on which the minimiser
    arrives too. No answer, or one that may be on another branch (flagged), is right where the path ends, beyond a
    bifurcation, or where the machine is deformed out of all proportion.
    """
    numbers = c.status in (Status.CONVERGED, Status.UNSTABLE)
    if numbers:
        if c.own is None or not c.own.off < OFF:
            return "not an equilibrium"
        if abs(c.own.lowest) > CRITICAL and (c.own.falling == 0) != (c.status == Status.CONVERGED):
            return "status against the eigenvalues at its own coordinates"
    elif c.own is not None:
        return "numbers without a status"
    if c.truth == "given up":
        return ""
    if c.truth == "singular":
        return "" if c.status == Status.SINGULAR else "singular, not said"
    if c.truth == "ends":
        return "" if c.told else "beyond the end of the path, not said"
    if c.told:
        return "" if c.crossed or c.moved > FAR else "not found, or not vouched for"
    if not numbers:
        return "no answer"
    if c.stable != (c.status == Status.CONVERGED):
        return "status against the eigenvalues"
    if c.flags & Flag.RIGID_DIRECTION and c.softness > YIELDS:
        return "a rigid direction that yields"
    return "" if c.gap < LIMIT else "another answer"


if __name__ == "__main__":
    sys.exit(main())
