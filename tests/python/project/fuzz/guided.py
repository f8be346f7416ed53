"""Fuzz one kind of file guided by coverage (libFuzzer through atheris): inputs that reach new lines are mutated further.

python -m tests.python.project.fuzz.guided --kind machine --count 100000 [--seed 1] [--corpus FOLDER]

Needs `pip install --group fuzz`. What reached something new is kept in --corpus, from where a later run goes on. Stops at the
first failure with a traceback, and libFuzzer writes the input (`crash-…`); give that file as INPUT to run it again.
"""

from __future__ import annotations

import argparse
import random
import resource
import sys
import tempfile
import warnings
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["stiffmap", "yaml"], enable_loader_override=False):
    from tests.python.project.fuzz.mutate import mutated, scratch
    from tests.python.project.fuzz.run import MEMORY, SECONDS, attempt
    from tests.python.project.fuzz.targets import TARGETS

OURS = 0.7
"""Share of mutations that know tokens and numbers; the others are libFuzzer's, of bytes."""


def main() -> None:
    """libFuzzer ends the process: 0 where no input failed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kind", choices=TARGETS, required=True)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--corpus", type=Path)
    parser.add_argument("input", type=Path, nargs="*")
    given = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    warnings.simplefilter("error", RuntimeWarning)
    target, place = TARGETS[given.kind], Path(tempfile.mkdtemp())
    corpus = given.corpus or place / "corpus"
    corpus.mkdir(parents=True, exist_ok=True)
    seeds = target.seeds()
    for i, text in enumerate(seeds):
        (corpus / f"seed-{i}").write_text(text, encoding="utf-8", newline="")

    def one_input(data: bytes) -> None:
        end = attempt(target, data.decode("utf-8", "replace"), place / "in")
        if end not in ("read", "refused"):
            raise AssertionError(end)

    def mutator(data: bytes, most: int, seed: int) -> bytes:
        rng = random.Random(seed)
        if rng.random() > OURS:
            return bytes(atheris.Mutate(data, most))
        text = data.decode("utf-8", "replace")
        text = scratch(rng, text) if rng.random() < 0.05 else mutated(rng, text, rng.choice((1, 1, 2, 4)))
        return text.encode("utf-8", "replace")[:most]

    runs = [str(p) for p in given.input] or [f"-runs={given.count}", str(corpus)]
    longest = 2 * max(len(text.encode()) for text in seeds)
    options = [f"-seed={given.seed}", f"-timeout={4 * SECONDS:g}", "-rss_limit_mb=0", f"-max_len={longest}"]
    atheris.Setup([sys.argv[0], *options, *runs], one_input, custom_mutator=mutator)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
