"""Readings that stand alone: found robustly, listed, never a whole pose or branch."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.noise.level import Noise, noise_of
from stiffmap.experiment.noise.whitening import Problem, nuisance_part

Mask = NDArray[np.bool_]
FALSE = 0.01
"""Probability of listing any row of a clean experiment."""
FEW = 0.02
"""Largest share of the poses that were read once and may be outliers: more of them are structure."""
MANY, LEAST_MANY = 0.1, 2
"""Share and number of rows beyond which those that stand alone before any effect is known are an effect."""
GROSS = 8.0
"""Robust standard deviations beyond which a reading is an outlier before any effect is known; a pose that was
read once is beyond them as a whole."""


def row_scores(residual: Floats, sigma: Floats) -> tuple[Floats, NDArray[np.intp]]:
    """(n,) squared length of each row's residual in standard deviations, and its readings."""
    z = residual / sigma
    count = np.isfinite(z).sum(axis=1)
    return np.nansum(z**2, axis=1), count


def outliers(experiment: Experiment, residual: Floats, sigma: Floats, *, lone: bool = False) -> Mask:
    """(n,) rows whose residual (n, 6) to a model that fits is too long for noise.

    A pose, or a branch, of which half or more would go is no outlier: it stays whole. With `lone`, poses that were read
    once may go beyond `GROSS`, if they are `FEW`: the model is then held by all the others.
    """
    score, count = row_scores(residual, sigma)
    p = chi2.sf(score, np.maximum(count, 1))
    found = np.asarray((p < FALSE / max(len(experiment), 1)) & (count > 0))
    out = whole_stays(experiment, found)
    if lone:
        once = np.bincount(experiment.groups)[experiment.groups] == 1
        gross = score > GROSS**2 + np.maximum(count - 1, 0)
        alone = gross & once & whole_stays(experiment, gross, poses=False)
        if alone.sum() <= FEW * once.sum():
            out |= alone
    return out


def suspects(experiment: Experiment, residual: Floats, sigma: Floats) -> Mask:
    """(n,) outliers before any effect is known, when residuals are structured.

    Repeats that contradict each other, the one farther from its condition's or the model's middle;
    and rows beyond `GROSS` robust standard deviations of all residuals of their axis.
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


def _worst(rows: NDArray[np.intp], z: Floats) -> NDArray[np.intp]:
    """Of conditions (g, m) rows of m repeats, whose readings are z (g, m, c), those rows that contradict the others."""
    read = np.isfinite(z)
    middle = _middle(z, read)
    away = np.where(read, z - middle[:, None], 0.0)
    score = np.sum(away**2, axis=2)
    freedom = np.maximum(read.sum(axis=(1, 2)) - read.any(axis=1).sum(axis=1), 1)
    found = chi2.sf(score.sum(axis=1), freedom) <= 1e-5
    if rows.shape[1] == 2:  # two that disagree: the one farther from the model
        score = np.sum(np.where(read, z, 0.0) ** 2, axis=2)
    return np.asarray(rows[found, np.argmax(score[found], axis=1)])


def _middle(z: Floats, read: Mask) -> Floats:
    """(g, c) medians over the repeats of (g, m, c) that were read; 0 where none was."""
    ranked = np.sort(np.where(read, z, np.inf), axis=1)
    count = read.sum(axis=1, keepdims=True)
    low, high = (np.take_along_axis(ranked, np.maximum(k, 0), axis=1) for k in ((count - 1) // 2, count // 2))
    high = np.where(count % 2 == 0, high, low)
    return np.asarray(np.where(count > 0, (low + high) / 2, 0.0)[:, 0])


def whole_stays(experiment: Experiment, found: Mask, *, poses: bool = True) -> Mask:
    """`found` without the rows of (poses and) branches that would lose half or more of their rows."""
    out = found.copy()
    labels = [experiment.groups] if poses else []
    if experiment.branch:
        labels.append(np.unique(experiment.branch, return_inverse=True)[1])
    for label in labels:
        total = np.bincount(label)
        share = np.bincount(label, found, len(total)) / total
        limit = np.where(total > 2, 0.5, 0.51)  # of two readings one may go
        out &= share[label] < limit[label]
    return out


def noise_without_suspects(experiment: Experiment, base: Floats) -> Noise:
    """The noise floor of readings that do not stand alone before any effect is known; `base` (n, c) is the declared prediction."""
    rough = noise_of(experiment)
    raw = experiment.reading - base
    bare = raw - nuisance_part(Problem.of(experiment, rough.sigma, base), raw)
    return noise_of(experiment, ~suspects(experiment, bare, rough.sigma))
