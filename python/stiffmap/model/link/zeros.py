"""Which entries of the compliance are zero: a test with family-wise control."""

from __future__ import annotations

import numpy as np
from scipy.stats import t

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
