"""Loads that run up and down in order of time: which way each row was reached."""

from __future__ import annotations

import numpy as np

from stiffmap.common.broadcasting import Floats, Integers

RETREAT = 0.02
"""Share of the whole range that a load goes back before it counts as turned: less is its noise."""
ROWS = 5
"""Rows per turn, at least, of a load that runs; one that jumps turns at every second row."""


def directions(wrench: Floats, order: Floats, run: Integers) -> Integers | None:
    """(n,) +1 where the load of a row was reached going up, -1 going down, 0 before it moves; None for loads that
    jump.

    wrench
        (n, 6), of which the component that varies most is followed.
    order
        (n,) of time.
    run
        (n,) number of the set-up: each starts afresh.
    """
    # forces and moments, each kind by its own largest range: what does not vary never counts
    range_ = np.ptp(wrench, axis=0)
    most = np.repeat([range_[:3].max(), range_[3:].max()], 3)
    load = wrench[:, int(np.argmax(range_ / np.where(most > 0, most, np.inf)))]
    span = float(np.ptp(load))
    if not span > 0.0:
        return None
    out = np.zeros(len(load), dtype=np.intp)
    turns = 0
    for k in np.unique(run):
        here = np.flatnonzero(run == k)
        here = here[np.argsort(order[here], kind="stable")]
        out[here], more = _followed(load[here], RETREAT * span)
        turns += more
    return out if turns * ROWS <= len(load) else None


def _followed(load: Floats, retreat: float) -> tuple[Integers, int]:
    """Direction at each row, and the number of turns."""
    out = np.zeros(len(load), dtype=np.intp)
    way, extreme, turns = 0, float(load[0]), 0
    for i, f in enumerate(load):
        gone = float(f) - extreme
        if way and gone * way >= 0:
            extreme = float(f)
        elif abs(gone) > retreat:
            turns += way != 0
            way, extreme = (1 if gone > 0 else -1), float(f)
        out[i] = way
    return out, turns
