"""Model-free checks: what deflections alone say about the machine, pose by pose, before any model.

Each check is a set of contrasts of mean readings that vanish for a linear, elastic, conservative
machine and true sensors. Their chi-square says whether noise explains them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from scipy.stats import chi2

from stiffmap.experiment.experiment import Experiment, Floats, Integers
from stiffmap.experiment.noise import Mask

Contrast = tuple[list[tuple[int, int]], list[float]]
"""(condition, axis) pairs and their weights."""

MEANING = {
    "linearity": "twice the force, twice the deflection",
    "sign reversal": "the opposite force gives the opposite deflection",
    "superposition": "the sum of two forces gives the sum of their deflections",
    "return to zero": "without force no deflection",
    "reciprocity": "the measured compliance is symmetric (Maxwell-Betti)",
    "hysteresis": "loading and unloading read the same",
}


@dataclass(frozen=True)
class Check:
    """One check: how many contrasts the plan allows (0: it cannot be made), their rms and chance."""

    name: str
    meaning: str
    contrasts: int
    rms: float
    """Root mean square of the contrasts over their standard deviations; 1 is noise."""
    p: float


def checks(experiment: Experiment, values: Floats, sigma: Floats, keep: Mask) -> list[Check]:
    """Checks of readings or residuals `values` (n, 6); only for deflections."""
    if experiment.quantity != "deflection":
        return []
    table = Conditions.of(experiment, values, sigma, keep)
    makers = {
        "linearity": linearity,
        "sign reversal": reversal,
        "superposition": superposition,
        "return to zero": zero,
        "reciprocity": reciprocity,
        "hysteresis": hysteresis,
    }
    return [table.test(name, list(make(table))) for name, make in makers.items()]


@dataclass(frozen=True, eq=False)
class Conditions:
    """Mean reading and its variance per condition."""

    mean: Floats
    variance: Floats
    wrench: Floats
    group: Floats
    unloading: Mask

    @staticmethod
    def of(experiment: Experiment, values: Floats, sigma: Floats, keep: Mask) -> Conditions:
        """Weighted means of the kept rows of each condition."""
        condition = experiment.conditions
        number = int(condition.max()) + 1
        good = np.isfinite(values) & np.isfinite(sigma) & keep[:, None]
        weight = np.where(good, 1.0 / np.where(good, sigma, 1.0) ** 2, 0.0)
        total = np.stack([np.bincount(condition, weight[:, a], number) for a in range(6)], axis=1)
        held = np.where(good, values, 0.0) * weight
        sums = np.stack([np.bincount(condition, held[:, a], number) for a in range(6)], axis=1)
        first = np.unique(condition, return_index=True)[1]
        with np.errstate(divide="ignore", invalid="ignore"):
            mean, variance = sums / total, 1.0 / total
        branch = np.array(experiment.branch or ("",) * len(experiment))
        return Conditions(
            np.where(total > 0, mean, np.nan),
            np.where(total > 0, variance, np.nan),
            experiment.wrench[first],
            experiment.groups[first].astype(float),
            branch[first] == "unloading",
        )

    def poses(self) -> Iterator[Integers]:
        """Condition numbers of each pose and branch."""
        for g in np.unique(self.group):
            for branch in (False, True):
                yield np.flatnonzero((self.group == g) & (self.unloading == branch))

    def test(self, name: str, contrasts: list[Contrast]) -> Check:
        """Chi-square of contrasts, each over its own standard deviation."""
        z = []
        for where, weights in contrasts:
            value = sum(w * self.mean[at] for at, w in zip(where, weights, strict=True))
            variance = sum(w**2 * self.variance[at] for at, w in zip(where, weights, strict=True))
            if np.isfinite(value) and variance > 0:
                z.append(value / np.sqrt(variance))
        total = float(np.sum(np.square(z)))
        rms = float(np.sqrt(total / len(z))) if z else float("nan")
        p = float(chi2.sf(total, len(z))) if z else float("nan")
        return Check(name, MEANING[name], len(z), rms, p)


def linearity(t: Conditions) -> Iterator[Contrast]:
    """Neighbouring sizes of the same force direction."""
    for here in t.poses():
        for line in _lines(t, here):
            for i, j in pairwise(line):
                si, sj = float(np.linalg.norm(t.wrench[i])), float(np.linalg.norm(t.wrench[j]))
                yield from (([(i, a), (j, a)], [1 / si, -1 / sj]) for a in range(6))


def _lines(t: Conditions, here: Integers) -> Iterator[list[int]]:
    size = np.linalg.norm(t.wrench[here], axis=1)
    loaded = here[size > 0]
    direction = np.round(t.wrench[loaded] / np.linalg.norm(t.wrench[loaded], axis=1, keepdims=True), 6)
    for d in np.unique(direction, axis=0) if len(loaded) else []:
        same = loaded[(direction == d).all(axis=1)]
        yield sorted((int(i) for i in same), key=lambda i: float(np.linalg.norm(t.wrench[i])))


def reversal(t: Conditions) -> Iterator[Contrast]:
    """Opposite forces."""
    for here in t.poses():
        for i, j in _matching(t, here, np.negative):
            if i < j:
                yield from (([(i, a), (j, a)], [1.0, 1.0]) for a in range(6))


def _matching(t: Conditions, here: Integers, change: Callable[[Floats], Floats]) -> Iterator[tuple[int, int]]:
    known = {tuple(np.round(t.wrench[i], 6) + 0.0): int(i) for i in here}
    for i in here:
        j = known.get(tuple(np.round(change(t.wrench[i]), 6) + 0.0))
        if j is not None and np.any(t.wrench[i]):
            yield int(i), j


def superposition(t: Conditions) -> Iterator[Contrast]:
    """Two forces along different lines and their sum."""
    for here in t.poses():
        for i in here:
            for j, k in _matching(t, here, partial(np.add, t.wrench[i])):
                if i < j and np.linalg.matrix_rank(t.wrench[[i, j]]) == 2:
                    yield from (([(int(i), a), (j, a), (k, a)], [1.0, 1.0, -1.0]) for a in range(6))


def zero(t: Conditions) -> Iterator[Contrast]:
    """Rows without load."""
    for i in np.flatnonzero(~t.wrench.any(axis=1)):
        yield from (([(int(i), a)], [1.0]) for a in range(6))


def reciprocity(t: Conditions) -> Iterator[Contrast]:
    """Deflection along j under unit force along i against that along i under unit force along j."""
    for here in t.poses():
        single = [int(i) for i in here if np.count_nonzero(t.wrench[i]) == 1 and t.wrench[i][:3].any()]
        best: dict[int, int] = {}
        for i in single:
            axis = int(np.argmax(np.abs(t.wrench[i])))
            if axis not in best or abs(t.wrench[i][axis]) > abs(t.wrench[best[axis]][axis]):
                best[axis] = i
        for a in best:
            for b in best:
                if a < b:
                    i, j = best[a], best[b]
                    yield [(i, b), (j, a)], [1 / t.wrench[i][a], -1 / t.wrench[j][b]]


def hysteresis(t: Conditions) -> Iterator[Contrast]:
    """The same load on both branches."""
    for g in np.unique(t.group):
        here = np.flatnonzero((t.group == g) & ~t.unloading)
        known = {tuple(np.round(t.wrench[i], 6)): int(i) for i in here}
        for j in np.flatnonzero((t.group == g) & t.unloading):
            i = known.get(tuple(np.round(t.wrench[j], 6)))
            if i is not None:
                yield from (([(i, a), (int(j), a)], [1.0, -1.0]) for a in range(6))
