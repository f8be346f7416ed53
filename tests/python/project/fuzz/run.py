"""Fuzz the readers of files: every input is read, or refused by one StiffmapError, within 5 s of processor time and bounded memory.

python -m tests.python.project.fuzz.run --kind machine --count 100000 --seed 1

Prints one line per failure with its seed (`--seed S --count 1` runs it again), and a summary.
"""

from __future__ import annotations

import argparse
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path
from types import FrameType

from tests.python.project.fuzz.mutate import mutated, scratch
from tests.python.project.fuzz.targets import TARGETS, Target

from stiffmap.common.errors import StiffmapError

SECONDS = 5.0
MEMORY = 6 << 30


class Hang(BaseException):
    """An input took longer than it may."""


def main() -> int:
    """0: every input was read or refused."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kind", choices=[*TARGETS, "all"], default="all")
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    signal.signal(signal.SIGPROF, _hang)
    warnings.simplefilter("error", RuntimeWarning)
    kinds = list(TARGETS) if given.kind == "all" else [given.kind]
    return int(sum(campaign(k, given.seed, given.count) for k in kinds) > 0)


def campaign(kind: str, first: int, count: int) -> int:
    """Run the inputs of some seeds; number of failures."""
    target, ends, slowest = TARGETS[kind], Counter[str](), 0.0
    seeds = target.seeds()
    with tempfile.TemporaryDirectory() as place:
        for seed in range(first, first + count):
            start = time.process_time()
            end = attempt(target, one_input(seeds, seed), Path(place) / "in")
            slowest = max(slowest, time.process_time() - start)
            ends[end.split(":")[0]] += 1
            if end not in ("read", "refused"):
                print(f"{kind} seed {seed}: {end}", flush=True)
    bad = count - ends["read"] - ends["refused"]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    print(
        f"{kind}: {count} inputs, {ends['read']} read, {ends['refused']} refused, {bad} failures, "
        f"slowest {slowest:.2f} s, peak {peak} MB",
        flush=True,
    )
    return bad


def one_input(seeds: list[str], seed: int) -> str:
    """The input of a seed."""
    rng = random.Random(seed)
    text = rng.choice(seeds)
    return scratch(rng, text) if rng.random() < 0.1 else mutated(rng, text, rng.choice((1, 1, 1, 2, 4, 12)))


def attempt(target: Target, text: str, folder: Path) -> str:
    """How an input ends: ``read``, ``refused``, or what went wrong."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        target.run(text, folder)
    except StiffmapError as error:
        message = str(error)
        return "refused" if message and len(message) < 8000 else f"message of {len(message)} characters"
    except Hang:
        return f"hang: more than {SECONDS:g} s"
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        return f"{type(error).__name__}: {error}"[:300]
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    return "read"


def _hang(_number: int, _frame: FrameType | None) -> None:
    raise Hang


if __name__ == "__main__":
    sys.exit(main())
