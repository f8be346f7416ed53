"""The columns of all variants, one per line, in the order in which screening takes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.noise.whitening import Problem
from stiffmap.identification.candidates.sensitivity import Variant
from stiffmap.identification.candidates.waves import Wave

Numbers = NDArray[np.intp]
AT_ONCE = 64
"""Variants that are whitened together."""


class Part(Protocol):
    """V variants of p columns each."""

    def along(self, y: Floats) -> Floats:
        """(V, p, S) products of the columns with (R, S)."""

    def gram(self, problem: Problem) -> Floats:
        """(V, p, p) products of the whitened columns of each variant."""

    def line(self, k: int) -> Floats:
        """(p, R) columns of variant k."""

    def only(self, chosen: Numbers) -> Part:
        """Some of the variants."""


@dataclass(frozen=True, eq=False)
class Dense:
    """Columns that are stored."""

    lines: Floats
    """(V, p, R)."""

    def along(self, y: Floats) -> Floats:
        v, p, r = self.lines.shape
        return np.asarray((self.lines.reshape(v * p, r) @ y).reshape(v, p, -1))

    def gram(self, problem: Problem) -> Floats:
        return np.concatenate(
            [gram_of(problem, self.lines[k : k + AT_ONCE]) for k in range(0, len(self.lines), AT_ONCE)]
        )

    def line(self, k: int) -> Floats:
        return np.asarray(self.lines[k])

    def only(self, chosen: Numbers) -> Dense:
        return Dense(self.lines[chosen])


def gram_of(problem: Problem, lines: Floats) -> Floats:
    """(V, p, p) products of the whitened columns of each of some variants (V, p, R)."""
    v, p, r = lines.shape
    white = np.ascontiguousarray(problem.white_lines(lines.reshape(v * p, r)).T).reshape(v, p, -1)
    return np.asarray(white @ white.transpose(0, 2, 1))


@dataclass(frozen=True, eq=False)
class Stack:
    """Variants, and their columns in parts of equally many."""

    variants: tuple[Variant, ...]
    members: tuple[Numbers, ...]
    """Per part the numbers of its variants."""
    parts: tuple[Part, ...]
    owner: Numbers
    """(V,) number of the candidate of each variant, counted as they come."""

    @staticmethod
    def of(variants: Sequence[Variant]) -> Stack:
        """Stored columns are copied into arrays of equally many per variant, which the variants then look into."""
        found = list(variants)
        keys = [id(v.lines.waves) if isinstance(v.lines, Wave) else len(v.lines) for v in found]
        members = tuple(np.flatnonzero(np.array(keys) == k) for k in dict.fromkeys(sorted(keys)))
        parts: list[Part] = []
        for m in members:
            first = found[m[0]].lines
            if isinstance(first, Wave):
                numbers = [w.number for i in m if isinstance(w := found[i].lines, Wave)]
                parts.append(first.waves.only(np.array(numbers, dtype=np.intp)))
                continue
            dense = Dense(np.stack([found[i].array() for i in m]))
            for k, i in enumerate(m):
                found[i] = replace(found[i], lines=dense.lines[k])
            parts.append(dense)
        number: dict[int, int] = {}
        owner = np.array([number.setdefault(id(v.candidate), len(number)) for v in found], dtype=np.intp)
        return Stack(tuple(found), members, tuple(parts), owner)

    def only(self, which: Numbers) -> Stack:
        """The stack of some of the variants, in their order."""
        place = np.full(len(self.variants), -1)
        place[which] = np.arange(len(which))
        chosen = [np.flatnonzero(place[m] >= 0) for m in self.members]
        some = [k for k, c in enumerate(chosen) if len(c)]
        return Stack(
            tuple(self.variants[i] for i in which),
            tuple(place[self.members[k][chosen[k]]].astype(np.intp) for k in some),
            tuple(self.parts[k].only(chosen[k]) for k in some),
            self.owner[which],
        )

    def place(self, i: int) -> tuple[int, int]:
        """Part of variant i, and its number there."""
        for g, m in enumerate(self.members):
            k = int(np.searchsorted(m, i))
            if k < len(m) and m[k] == i:
                return g, k
        raise IndexError(i)
