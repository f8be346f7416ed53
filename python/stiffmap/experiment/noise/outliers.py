"""Readings that stand alone: found robustly, listed, never a whole pose or branch."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from scipy.special import chdtrc

from stiffmap.common.broadcasting import Mask
from stiffmap.common.short import first_of
from stiffmap.experiment.experiment import Experiment, Floats, Integers
from stiffmap.experiment.noise.level import Noise, noise_of
from stiffmap.experiment.noise.whitening import LinearProblem, nuisance_part
from stiffmap.experiment.setups import target_positions

MANY, LEAST_MANY = 0.1, 2
"""Share and number of rows beyond which those that stand alone before any effect is known are an effect."""
GROSS = 8.0
"""Robust standard deviations beyond which a reading is an outlier before any effect is known; a pose that was
read once is beyond them as a whole."""


def suspects(experiment: Experiment, residual: Floats, sigma: Floats) -> Mask:
    """(n,) outliers before any effect is known, when residuals are structured.

    Repeats that contradict each other, the one farther from its condition's or the model's middle;
    and rows beyond `GROSS` robust standard deviations of all residuals of their axis, poses that were read once among them.
    """
    residual, sigma = residual[:, experiment.axis_read], sigma[:, experiment.axis_read]
    away = np.abs(residual - np.nanmedian(residual, axis=0))
    gross = np.asarray(np.any(away > GROSS * np.fmax(1.4826 * np.nanmedian(away, axis=0), sigma), axis=1))
    lonely = _lonely(experiment, residual, sigma, gross)
    if lonely.sum() > max(LEAST_MANY, MANY * len(experiment)):
        lonely[:] = False  # they say together what no repeat had to confirm
    return whole_stays(experiment, _contradicting(experiment, residual, sigma) | lonely)


def _lonely(experiment: Experiment, residual: Floats, sigma: Floats, gross: Mask) -> Mask:
    """Gross rows that no other reading of their condition confirms."""
    out = gross.copy()
    for i in np.flatnonzero(gross):
        same = np.flatnonzero(experiment.conditions == experiment.conditions[i])
        near = (np.abs(residual[same] - residual[i]) < 6.0 * sigma[same]) | ~np.isfinite(residual[same])
        out[i] = near.all(axis=1).sum() < 2
    return out


def _contradicting(experiment: Experiment, residual: Floats, sigma: Floats) -> Mask:
    """In each condition whose repeats scatter too much, the row farthest from the others or from zero."""
    out = np.zeros(len(experiment), bool)
    condition = experiment.conditions
    order, count = np.argsort(condition, kind="stable"), np.bincount(condition)
    first = np.cumsum(count) - count
    z = residual / sigma
    for n in np.unique(count[count > 1]):
        rows = order[first[count == n][:, None] + np.arange(n)]
        out[_worst(rows, z[rows])] = True
    return out


def _worst(rows: Integers, z: Floats) -> Integers:
    """Of conditions (g, m) rows of m repeats, whose readings are z (g, m, c), those rows that contradict the others."""
    read = np.isfinite(z)
    some = read.any(axis=1, keepdims=True)
    middle = np.nanmedian(np.where(some, np.where(read, z, np.nan), 0.0), axis=1)
    away = np.where(read, z - middle[:, None], 0.0)
    score = np.sum(away**2, axis=2)
    freedom = np.maximum(read.sum(axis=(1, 2)) - some.sum(axis=(1, 2)), 1)
    found = chdtrc(freedom, score.sum(axis=1)) <= 1e-5
    if rows.shape[1] == 2:  # two that disagree: the one farther from the model
        score = np.sum(np.where(read, z, 0.0) ** 2, axis=2)
    return np.asarray(rows[found, np.argmax(score[found], axis=1)])


def swapped(experiment: Experiment, left: Floats, sigma: Floats, out: Mask) -> list[tuple[int, int]]:
    """Pairs of outliers `out` (n,) that fit where each has the reading of the other; `left` (n, c) is what the model leaves of the
    readings."""
    where = np.zeros_like(left)
    if experiment.quantity == "position":
        where[:, :3] = target_positions(experiment)
    shown = where + experiment.reading - left
    rows = np.flatnonzero(out).tolist()
    pairs: list[tuple[int, int]] = []
    if len(rows) < 2:
        return pairs
    typical = [np.median(np.abs(v[np.isfinite(v)])) if np.isfinite(v).any() else np.nan for v in left[~out].T]
    limit = GROSS * np.fmax(1.4826 * np.array(typical), sigma)
    for i, j in combinations(rows, 2):
        moved = shown[j] - shown[i]
        both = np.stack([left[j] + moved, left[i] - moved]) / limit[[i, j]]
        read = np.isfinite(both)
        if read.any() and (np.abs(both[read]) < 1.0).all():
            pairs.append((i, j))
    return pairs


def set_aside(ids: Sequence[str], pairs: Sequence[tuple[str, str]]) -> list[str]:
    """Outliers in words, and which of them look swapped."""
    if not ids:
        return []
    plural = "s" if len(ids) > 1 else ""
    out = [f"set aside as outlier{plural}: row{plural} {first_of(ids)}"]
    return out + [f"rows {a} and {b} fit as swapped: each as the reading of the other" for a, b in pairs]


def whole_stays(experiment: Experiment, found: Mask) -> Mask:
    """`found` without the rows of branches, and of poses that were read more than once, that would lose half or more of their
    rows."""
    out = found.copy()
    labels = [experiment.groups]
    if experiment.branch:
        labels.append(np.unique(experiment.branch, return_inverse=True)[1])
    for label in labels:
        total = np.bincount(label)
        share = np.bincount(label, found, len(total)) / total
        limit = np.where(total > 2, 0.5, 0.51)  # of two readings one may go
        limit = np.where(total > 1, limit, np.inf)
        out &= share[label] < limit[label]
    return out


def without_suspects(experiment: Experiment, base: Floats) -> tuple[Noise, Mask]:
    """The noise floor of readings that do not stand alone before any effect is known, and (n,) those that do; `base` (n, c) is the
    declared prediction. One that is far off hides another one, so they are looked for until there is none."""
    out, found = np.zeros(len(experiment), bool), None
    while True:
        noise = noise_of(experiment, ~out)
        problem = LinearProblem.of(experiment, noise.sigma, base, ~out)
        if found is not None and problem.freedom < 1:
            return found  # as many unknowns as readings fit anything
        bare = experiment.reading - base
        bare -= nuisance_part(problem, bare, robust=True)
        bare[out] = np.nan
        more = whole_stays(experiment, out | suspects(experiment, bare, noise.sigma))
        found = noise, out
        if not (more & ~out).any():
            return found
        out = out | more
