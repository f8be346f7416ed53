"""Model-free checks: what deflections alone say about the machine, pose by pose, before any model.

Each check is a set of contrasts of mean readings that vanish for a linear, elastic, conservative
machine and true sensors. Contrasts of one pose share means, and readings of one pose share a zero: their
covariance is taken whole, so that the chi-square is one under noise (docs/experiments.md).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.noise.conditions import Conditions, Contrast
from stiffmap.experiment.noise.contrasts import CONTRASTS
from stiffmap.experiment.noise.level import Mask

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
        value, covariance = table.values_of(here), table.covariance_of(here)
        squares += (value**2 / np.diag(covariance)).tolist()
        drop, r = _chi_square(value, covariance)
        total, rank = total + drop, rank + r
    rms = float(np.sqrt(np.mean(squares)))
    return Check(name, meaning, len(contrasts), rms, float(chi2.sf(total, rank)))


def _chi_square(value: Floats, covariance: Floats) -> tuple[float, int]:
    """Square of values over their covariance, which lacks rank where contrasts depend on each other."""
    scale = np.sqrt(np.diag(covariance))
    eigenvalues, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    good = eigenvalues > 1e-9 * eigenvalues[-1]
    along = vectors[:, good].T @ (value / scale)
    return float(np.sum(along**2 / eigenvalues[good])), int(good.sum())
