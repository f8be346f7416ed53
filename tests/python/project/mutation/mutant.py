"""One small change to a source, and a fair sample of many."""

from __future__ import annotations

import random
from collections.abc import Iterable
from dataclasses import dataclass

#: Mutants of each kind in a sample, as parts of the whole: not as often as they stand in the sources, where thresholds
#: are one in fifty.
SHARES = {
    "sign": 3,
    "dropped term": 3,
    "factor": 3,
    "comparison": 3,
    "swapped arguments": 2,
    "threshold": 1,
}


@dataclass(frozen=True, order=True)
class Mutant:
    """``source[start:end]`` of a file becomes `text`."""

    file: str  # from the root of the repository
    line: int
    start: int
    end: int
    kind: str
    text: str
    before: str  # the line as it stands, for people


def line_of(source: str, start: int) -> tuple[int, str]:
    """The number of a position's line, from one, and its text."""
    begin = source.rfind("\n", 0, start) + 1
    end = source.find("\n", start)
    return source.count("\n", 0, start) + 1, source[begin : end if end >= 0 else None].strip()


def shuffled(mutants: Iterable[Mutant], seed: int) -> list[Mutant]:
    """All in an order that depends on the seed only, any first part of it in the shares of the kinds."""
    chance, mutants = random.Random(seed), list(mutants)
    by_kind = {
        kind: chance.sample(found, len(found))
        for kind in SHARES
        if (found := sorted({m for m in mutants if m.kind == kind}))
    }
    out: list[Mutant] = []
    taken: dict[str, list[Mutant]] = {}
    while by_kind:
        kind = chance.choices(list(by_kind), [SHARES[k] for k in by_kind])[0]
        mutant = by_kind[kind].pop()
        others = taken.setdefault(mutant.file, [])
        if all(mutant.end < other.start or mutant.start > other.end for other in others):
            out.append(mutant)  # two at one place could not be compiled at once
            others.append(mutant)
        if not by_kind[kind]:
            del by_kind[kind]
    return out
