"""Groups of unknowns that are off by more than their standard uncertainties say, all of them.

Where no single number stands out, those of one group may all be worse than declared: each group's standard
uncertainties in turn are multiplied by what the evidence gains most by (its hyperparameter by maximum likelihood).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from stiffmap.experiment.experiment import Floats
from stiffmap.identification.calibration.facts import Wider
from stiffmap.identification.calibration.groups import LIKE, STRONG
from stiffmap.identification.calibration.statistics import Sums

TIMES = (3.0, 10.0)
FEWEST = 2
"""Unknowns that make a group; one that is off alone is `beyond_tolerance`'s."""


def widened(
    sums: Sums, members: Mapping[str, Sequence[int]], certain: Sequence[str]
) -> tuple[tuple[Wider, ...], Floats]:
    """The groups whose uncertainties are too small, and (p,) the factor on each; `certain` groups stay."""
    factor = np.ones(len(sums.right))
    groups = {g: list(i) for g, i in members.items() if len(i) >= FEWEST and g not in certain}
    price = STRONG + float(np.log(max(len(groups) * len(TIMES), 1)))
    found: list[Wider] = []
    while True:
        now = sums.scaled(factor).log_evidence
        trials: dict[str, tuple[float, float]] = {}
        for g, which in groups.items():
            for f in TIMES if g not in [w.group for w in found] else ():
                trial = factor.copy()
                trial[which] *= f
                gain = sums.scaled(trial).log_evidence - now
                trials[g] = max(trials.get(g, (-np.inf, 1.0)), (gain, f))
        best = max(trials, key=lambda g: trials[g][0], default=None)
        if best is None or trials[best][0] < price:
            return tuple(found), factor
        nats, times = trials[best]
        all_gained = now + nats - sums.pick([]).log_evidence
        enough = max(nats - max(STRONG, LIKE * all_gained), STRONG)
        rivals = tuple(g for g, (gain, _) in trials.items() if g != best and gain > enough)
        factor[groups[best]] *= times
        found.append(Wider(best, times, float(nats), rivals))
