"""Which entries of the compliance are zero: a test with family-wise control, and what it misses."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import nct, t

from stiffmap.model.link.arrays import Bools, Floats


def critical_multiple(level: float, tests: int, dof: Floats | float) -> Floats:
    """The paper's k of "k sigma": |entry| below k standard errors is not distinguishable from zero, link (8).

    Bonferroni over ``tests`` entries: the probability that any entry that is truly zero is taken for
    non-zero stays below ``level`` whatever the correlation of the entries.
    """
    return np.asarray(t.isf(level / (2 * tests), dof))


def insignificant_entries(compliance: Floats, error: Floats, dof: Floats, level: float, tests: int) -> Bools:
    """(6, 6) bool, True where the entry is zero within the test's family-wise level.

    Args:
        compliance, error, dof: (6, 6) entries, standard errors and degrees of freedom.
        level: family-wise level; tests: distinct entries (21 under symmetry, else 36).
    """
    return np.asarray(np.abs(compliance) <= critical_multiple(level, tests, dof) * error)


def miss_probability(
    true_entry: ArrayLike, error: ArrayLike, dof: Floats | float, level: float, tests: int
) -> Floats:
    """Probability that an entry of this true size is declared zero: noncentral t, link (9).

    At ``true_entry = 0`` it is ``1 - level / tests``.
    """
    k, shift = critical_multiple(level, tests, dof), np.asarray(true_entry) / np.asarray(error)
    # Beyond 1e6 degrees of freedom t is normal to 1e-6 and nct loses accuracy.
    nu = np.minimum(np.asarray(dof, dtype=float), 1e6)
    return np.asarray(nct.cdf(k, nu, shift) - nct.cdf(-k, nu, shift))
