"""Rows taken one after the other, then exchanged while that gains (V. V. Fedorov, Theory of Optimal Experiments, 1972)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.experiment.experiment import Integers

PASSES = 3
Value = Callable[[Floats], Floats]
"""Worth (...) of information matrices (..., k, k)."""


def exchange(
    matrices: Floats, start: Floats, free: Integers, rows: int, value: Value, passes: int = PASSES
) -> Integers:
    """Indices of the rows chosen: greedily, then exchanged while that gains, in so many passes."""
    left = [int(i) for i in free]
    picked: list[int] = []
    total = start.copy()
    for _ in range(rows):
        best = left[int(np.argmax(value(total + matrices[left])))]
        picked.append(best)
        left.remove(best)
        total = total + matrices[best]
    for _ in range(passes):
        changed = False
        for place, old in enumerate(picked):
            bare = total - matrices[old]
            options = [old, *left]
            scores = value(bare + matrices[options])
            k = int(np.argmax(scores))
            if k and scores[k] > scores[0] + 1e-9 * (1 + abs(scores[0])):
                new = options[k]
                picked[place] = new
                left.remove(new)
                left.append(old)
                total, changed = bare + matrices[new], True
        if not changed:
            break
    return np.array(picked, dtype=np.intp)
