"""Groups of unknowns compared by evidence, jointly with those that every machine has.

The evidence of a set of groups is the marginal likelihood of all readings with every unknown of the set at
its prior; differences in nats. Sets are compared, not single exchanges: two groups of which each
explains what the other does are rivals, and the verdict names both.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from stiffmap.identification.calibration.statistics import Sums

BASE = ("zeros", "tool")
"""Groups that every machine has: the others are compared in addition to them."""
LIKE = 0.1
"""Share of the evidence that all chosen groups gain within which another set is a rival: models are no better."""
STRONG = 5.0
"""Nats: odds of 150, before which a group or a name is not preferred to another."""


@dataclass(frozen=True)
class GroupEvidence:
    """What a group adds to the evidence."""

    name: str
    alone: float
    """Nats gained over the base alone."""
    last: float
    """Nats lost when the group is taken out of the full set."""
    unknowns: int
    rivals: tuple[str, ...] = ()
    """Groups that would explain as much (`STRONG` nats, `LIKE`) as this one does."""


@dataclass(frozen=True)
class Choice:
    """The set of groups with the best evidence."""

    chosen: tuple[str, ...]
    evidence: float
    groups: tuple[GroupEvidence, ...]
    rivals: tuple[tuple[str, ...], ...] = ()
    """Sets of groups that explain as much as the chosen one and do not contain it."""


def compare(sums: Sums, members: Mapping[str, Sequence[int]], base: Sequence[str] = ()) -> Choice:
    """Forward and backward over groups; then every set in which chosen groups are exchanged for others."""
    names = [n for n in members if n not in base and len(members[n])]

    root, y = sums.root()

    def evidence(chosen: Sequence[str]) -> float:
        """As `Sums.log_evidence`, through the smaller of the two determinants."""
        index = [i for n in (*base, *chosen) for i in members.get(n, ())]
        r = root[:, index]
        inner = np.eye(len(y)) + r @ r.T
        chi2 = sums.square - float(y @ y) + float(y @ np.linalg.solve(inner, y))
        return -0.5 * (chi2 + float(np.linalg.slogdet(inner)[1]))

    memory: dict[frozenset[str], float] = {}

    def known(chosen: Sequence[str]) -> float:
        key = frozenset(chosen)
        if key not in memory:
            memory[key] = evidence(tuple(sorted(key)))
        return memory[key]

    chosen: list[str] = []
    while True:
        trials = [(known([*chosen, n]), n) for n in names if n not in chosen]
        fewer = [(known([m for m in chosen if m != n]), n) for n in chosen]
        add = max(trials, default=(-np.inf, ""))
        drop = max(fewer, default=(-np.inf, ""))
        now = known(chosen)
        if add[0] > max(now + 1.0, drop[0]):
            chosen.append(add[1])
        elif drop[0] > now:
            chosen.remove(drop[1])
        else:
            break
    best = known(chosen)
    enough = best - max(STRONG, LIKE * (best - known([])))
    rivals = _rivals(known, names, chosen, enough)
    groups = tuple(
        GroupEvidence(
            n,
            known([n]) - known([]),
            best - known([m for m in chosen if m != n]) if n in chosen else known([*chosen, n]) - best,
            len(members[n]),
            tuple(sorted({m for r in rivals if n in chosen and n not in r for m in r if m not in chosen})),
        )
        for n in names
    )
    return Choice(tuple(chosen), best, groups, tuple(rivals))


def _rivals(
    known: Callable[[Sequence[str]], float], names: Sequence[str], chosen: Sequence[str], enough: float
) -> list[tuple[str, ...]]:
    """Sets with one or two chosen groups exchanged for as many others, or left out, that explain as well."""
    out: list[tuple[str, ...]] = []
    others = [n for n in names if n not in chosen]
    for k in (1, 2):
        for gone in combinations(chosen, k):
            kept = [n for n in chosen if n not in gone]
            for new in [c for m in range(k + 1) for c in combinations(others, m)]:
                trial = tuple(sorted([*kept, *new]))
                longer = any(set(r) <= set(trial) for r in out)
                if not longer and known(trial) > enough:
                    out.append(trial)
    return sorted(out, key=lambda t: -known(t))
