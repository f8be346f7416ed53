"""Model-free checks: what deflections alone say about the machine, pose by pose, before any model.

Each check is a set of contrasts of mean readings that vanish for a linear, elastic, conservative
machine and true sensors. Contrasts of one pose share means, and readings of one pose share a zero: their
covariance is taken whole, so that the chi-square is one under noise (docs/experiments.md).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import combinations, pairwise

import numpy as np
from scipy.special import chdtrc

from stiffmap.common.broadcasting import Mask
from stiffmap.experiment.experiment import Experiment, Floats, Integers, numbered
from stiffmap.experiment.noise.level import sums

Contrast = tuple[list[tuple[int, int]], list[float]]
"""(condition, channel) pairs and their weights."""


@dataclass(frozen=True, eq=False)
class Conditions:
    """Means of repeats; k conditions, c channels."""

    mean: Floats
    """(k, c)."""
    variance: Floats
    """(k, c) of the mean, the zero apart."""
    zero: Floats
    """(c,) variance of the zero that a pose's readings share."""
    zero_known: bool
    """False: the state without load is unknown, and only what does not depend on it can be tested."""
    wrench: Floats
    group: Integers
    """(k,) pose number."""
    state: Integers
    """(k,) number of the pose and of all that may differ between its conditions but the load: only alike ones are compared.
    Temperature is not among it: the unloaded reading is as warm as the loaded one."""
    unloading: Mask
    work_conjugate: bool
    """Whether the force acts where the reading is taken, from and to the floor or base."""

    @staticmethod
    def of(e: Experiment, values: Floats, sigma: Floats, keep: Mask) -> Conditions:
        """Weighted means of the kept rows of each condition."""
        good = np.isfinite(values) & np.isfinite(sigma) & keep[:, None]
        weight = np.divide(1.0, sigma**2, out=np.zeros(sigma.shape), where=good)
        total = sums(weight, e.conditions)
        mean = sums(np.multiply(values, weight, out=weight, where=good), e.conditions)
        first = np.unique(e.conditions, return_index=True)[1]
        branch = np.array(e.branch or ("",) * len(e))[first]
        safe = np.where(total > 0, total, 1.0)
        return Conditions(
            np.where(total > 0, mean / safe, np.nan),
            np.where(total > 0, 1.0 / safe, np.nan),
            e.zeros**2,
            e.unloaded != "unknown",
            e.wrench[first],
            e.groups[first],
            e.states[first],
            branch == "unloading",
            _conjugate(e),
        )

    def usable(self, contrast: Contrast) -> bool:
        """Whether all means are known, and the zero cancels where it is not."""
        where, weights = contrast
        if not all(np.isfinite(self.mean[at]) for at in where):
            return False
        return self.zero_known or abs(sum(weights)) < 1e-12

    def of_contrasts(self, contrasts: list[Contrast]) -> tuple[Floats, Floats]:
        """(m,) contrasts of one pose, and their covariance (m, m)."""
        cells = sorted({at for where, _ in contrasts for at in where})
        index = {at: i for i, at in enumerate(cells)}
        matrix = np.zeros((len(contrasts), len(cells)))
        for row, (where, weights) in enumerate(contrasts):
            for at, w in zip(where, weights, strict=True):
                matrix[row, index[at]] += w
        condition, channel = np.array(cells).T
        shared = np.where(channel[:, None] == channel, self.zero[channel], 0.0)
        v = np.diag(self.variance[condition, channel]) + shared
        return matrix @ self.mean[condition, channel], matrix @ v @ matrix.T


def _conjugate(e: Experiment) -> bool:
    points = e.points or (e.point,) * len(e)
    loads = e.load_points or (e.load_point,) * len(e)
    whole = e.loop.instrument_on == e.loop.force_against and e.loop.target_on == "tool"
    return points == loads and whole


BROKEN = 1e-4
"""p-value of the linearity below which reciprocity says nothing: it holds for linear machines only."""


@dataclass(frozen=True)
class Check:
    """One check: how many contrasts the plan allows (0: it cannot be made), their rms and p-value."""

    name: str
    meaning: str
    contrasts: int
    rms: float
    """Root mean square of the contrasts over their standard deviations; 1 is noise."""
    p: float
    note: str = ""
    """Why it could not be made, or why its p-value says nothing."""


def checks(experiment: Experiment, values: Floats, sigma: Floats, keep: Mask) -> list[Check]:
    """Checks of readings or residuals `values` (n, c); only for deflections."""
    if experiment.quantity != "deflection":
        return []
    table = Conditions.of(experiment, values, sigma, keep)
    found = {name: _test(table, name, meaning, make) for name, (meaning, make) in CONTRASTS.items()}
    linear, reciprocal = found["linearity"], found["reciprocity"]
    if linear.contrasts and linear.p < BROKEN and reciprocal.contrasts:
        note = "says nothing: the machine is not linear"
        found["reciprocity"] = Check("reciprocity", reciprocal.meaning, 0, reciprocal.rms, np.nan, note)
    return list(found.values())


def _test(
    table: Conditions, name: str, meaning: str, make: Callable[[Conditions], Iterator[Contrast]]
) -> Check:
    contrasts = [c for c in make(table) if table.usable(c)]
    if not contrasts:
        return Check(name, meaning, 0, float("nan"), float("nan"), "the plan does not allow it")
    total, rank, squares = 0.0, 0, []
    of_pose: dict[int, list[Contrast]] = {}
    for c in contrasts:
        of_pose.setdefault(int(table.group[c[0][0][0]]), []).append(c)
    for here in of_pose.values():
        value, covariance = table.of_contrasts(here)
        squares += (value**2 / np.diag(covariance)).tolist()
        drop, r = _chi_square(value, covariance)
        total, rank = total + drop, rank + r
    rms = float(np.sqrt(np.mean(squares)))
    return Check(name, meaning, len(contrasts), rms, float(chdtrc(rank, total)))


def _chi_square(value: Floats, covariance: Floats) -> tuple[float, int]:
    """Square of values over their covariance, which lacks rank where contrasts depend on each other."""
    scale = np.sqrt(np.diag(covariance))
    eigenvalues, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    good = eigenvalues > 1e-9 * eigenvalues[-1]
    along = vectors[:, good].T @ (value / scale)
    return float(np.sum(along**2 / eigenvalues[good])), int(good.sum())


def alike(t: Conditions) -> Iterator[Integers]:
    """Conditions of each pose that differ by their load only; where there is but one nothing can be contrasted."""
    return (here for here in _grouped(t.state) if here.size > 1)


def _grouped(key: Integers) -> list[Integers]:
    """Rows of each value of the key, rising."""
    order = np.argsort(key, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(key[order])) + 1)


def _every(t: Conditions, rows: list[int], weights: list[float]) -> Iterator[Contrast]:
    """The same contrast in every channel."""
    yield from (([(i, a) for i in rows], weights) for a in range(t.mean.shape[1]))


def linearity(t: Conditions) -> Iterator[Contrast]:
    """Neighbouring sizes of the same direction of force."""
    for here in alike(t):
        for line in _lines(t, here):
            for i, j in pairwise(line):
                si, sj = float(np.linalg.norm(t.wrench[i])), float(np.linalg.norm(t.wrench[j]))
                yield from _every(t, [i, j], [1.0, -si / sj])


def _lines(t: Conditions, here: Integers) -> Iterator[list[int]]:
    size = np.linalg.norm(t.wrench[here], axis=1)
    loaded, size = here[size > 0], size[size > 0]
    order = np.argsort(size, kind="stable")
    along = np.round(t.wrench[loaded] / size[:, None], 6)
    for line in _grouped(numbered([along])[order]) if size.size else ():
        yield loaded[order[line]].tolist()


def reversal(t: Conditions) -> Iterator[Contrast]:
    """Opposite forces."""
    for here in alike(t):
        for i, j in _matching(t, here, np.negative):
            if i < j:
                yield from _every(t, [i, j], [1.0, 1.0])


def _matching(t: Conditions, here: Integers, change: Callable[[Floats], Floats]) -> Iterator[tuple[int, int]]:
    known = {_key(t.wrench[i]): int(i) for i in here}
    for i in here:
        j = known.get(_key(change(t.wrench[i])))
        if j is not None and np.any(t.wrench[i]):
            yield int(i), j


def _key(wrench: Floats) -> tuple[float, ...]:
    return tuple(np.round(wrench, 6) + 0.0)


def superposition(t: Conditions) -> Iterator[Contrast]:
    """Two forces along different lines and their sum."""
    for here in alike(t):
        for i in here:
            for j, k in _matching(t, here, partial(np.add, t.wrench[i])):
                if i < j and np.linalg.matrix_rank(t.wrench[[i, j]]) == 2:
                    yield from _every(t, [int(i), j, k], [1.0, 1.0, -1.0])


def zero(t: Conditions) -> Iterator[Contrast]:
    """Rows without load."""
    for i in np.flatnonzero(~t.wrench.any(axis=1)):
        yield from _every(t, [int(i)], [1.0])


def reciprocity(t: Conditions) -> Iterator[Contrast]:
    """Motion along b under unit force along a against that along a under unit force along b."""
    if not t.work_conjugate:
        return
    for here in alike(t):
        best: dict[int, int] = {}
        for i in (int(i) for i in here if np.count_nonzero(t.wrench[i]) == 1):
            a = int(np.argmax(np.abs(t.wrench[i])))
            if a not in best or abs(t.wrench[i][a]) > abs(t.wrench[best[a]][a]):
                best[a] = i
        for a, b in combinations(sorted(best), 2):
            i, j = best[a], best[b]
            yield [(i, b), (j, a)], [1.0, -float(t.wrench[i][a] / t.wrench[j][b])]


def hysteresis(t: Conditions) -> Iterator[Contrast]:
    """The same load on both branches."""
    if not t.unloading.any():
        return
    for pose in _grouped(t.group):
        known = {_key(t.wrench[i]): int(i) for i in pose[~t.unloading[pose]]}
        for j in pose[t.unloading[pose]]:
            i = known.get(_key(t.wrench[j]))
            if i is not None:
                yield from _every(t, [i, int(j)], [1.0, -1.0])


CONTRASTS: dict[str, tuple[str, Callable[[Conditions], Iterator[Contrast]]]] = {
    "linearity": ("twice the force, twice the deflection", linearity),
    "sign reversal": ("the opposite force gives the opposite deflection", reversal),
    "superposition": ("the sum of two forces gives the sum of their deflections", superposition),
    "return to zero": ("without force no deflection", zero),
    "reciprocity": ("the measured compliance is symmetric (Maxwell-Betti)", reciprocity),
    "hysteresis": ("loading and unloading read the same", hysteresis),
}
"""Name of each check: what it says of the machine, and its contrasts."""
