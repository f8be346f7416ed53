"""Noise of the field from its residuals, (20) of the paper: per case, pooled where homogeneous."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from stiffmap.model.link.arrays import Floats, Ints

HOMOGENEITY_LEVEL = 0.01


class FieldNoise(NamedTuple):
    """Standard deviation of one displacement component."""

    sigma: Floats  # (cases,) m, each case by itself
    dof: Ints  # (cases,) 3 n - 6 for the nodes kept
    used: Floats  # (cases,) m, what the covariance is built on
    used_dof: Floats  # (cases,) degrees of freedom behind `used`; inf when the noise is given
    homogeneity: float  # p-value of "all cases have the same sigma"; NaN when not testable
    pooled: bool


def estimate_noise(rss: Floats, dof: Ints, floor: Floats) -> FieldNoise:
    """Noise of each case from its residual sum of squares (m²), link (5).

    The cases are pooled, with the sum of their degrees of freedom, when Bartlett's test does not distinguish their
    variances at 1 %. ``floor`` (cases,) is the round-off of the field in m: below it a
    residual is not noise but arithmetic.
    """
    sigma = np.sqrt(rss / np.maximum(dof, 1))
    sized = np.maximum(sigma, floor)
    p = bartlett(sized**2, dof)
    pooled = bool(np.isnan(p) or p > HOMOGENEITY_LEVEL)
    if not pooled:
        return FieldNoise(sigma, dof, sized, dof.astype(float), p, False)
    common = np.sqrt(np.sum(dof * sized**2) / np.sum(dof))
    full = np.ones(len(rss))
    return FieldNoise(sigma, dof, common * full, float(np.sum(dof)) * full, p, True)


def bartlett(variance: Floats, dof: Ints) -> float:
    """p-value of Bartlett's test that independent variances with these degrees of freedom are equal.

    NaN for a single case or when all variances are at zero.
    """
    k, total = len(variance), float(np.sum(dof))
    if k < 2 or not np.all(variance > 0) or np.any(dof < 1):
        return float("nan")
    common = float(np.sum(dof * variance) / total)
    statistic = total * np.log(common) - float(np.sum(dof * np.log(variance)))
    correction = 1 + (float(np.sum(1 / dof)) - 1 / total) / (3 * (k - 1))
    return float(chi2.sf(statistic / correction, k - 1))
