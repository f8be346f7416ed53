"""Before the run: which field and which force give a wanted accuracy (the paper's n-dependence)."""

from __future__ import annotations

import math

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.model.link.arrays import Floats
from stiffmap.model.link.checks import check_points, identifiable_columns
from stiffmap.model.link.regression import regress
from stiffmap.model.link.rigidfit import fit_factor


def planned_error(points: Floats, wrenches: Floats, reference: Floats, sigma: float) -> Floats:
    """(6, 6) standard errors of the compliance that independent noise ``sigma`` (m) will give, link (15).

    Args:
        points: (n, 3) m, the planned nodes; wrenches: (cases, 6) N, N·m; reference: (3,) m.
    """
    check_points(points)
    identifiable_columns(wrenches, partial=False)
    covariance = sigma**2 * np.tile(fit_factor(points, reference), (len(wrenches), 1, 1))
    fit = regress(wrenches, np.zeros((len(wrenches), 6)), covariance)
    return np.sqrt(np.diag(fit.covariance)).reshape(6, 6)


def smallest_nodes(points: Floats, wrenches: Floats, reference: Floats, sigma: float, wanted: Floats) -> int:
    """Smallest number of independent nodes, spread like ``points``, for errors below ``wanted`` (6, 6).

    Errors fall as 1/sqrt(n) in a region of given shape; entries with an infinite or NaN wish do not count.
    """
    ratio = _ratio(planned_error(points, wrenches, reference, sigma), wanted)
    return max(3, math.ceil(len(points) * ratio**2 * (1 - 1e-12)))


def smallest_force(
    points: Floats, wrenches: Floats, reference: Floats, sigma: float, wanted: Floats
) -> float:
    """Smallest common factor on the wrenches for errors below ``wanted`` (6, 6): they fall as 1/force."""
    return _ratio(planned_error(points, wrenches, reference, sigma), wanted)


def _ratio(error: Floats, wanted: Floats) -> float:
    wish = np.where(np.isnan(wanted), np.inf, wanted)
    if wish.shape != (6, 6) or np.any(wish <= 0):
        raise StiffmapError(
            f"wanted: expected (6, 6) positive errors, got shape {wish.shape}, smallest {wish.min()}"
        )
    return float(np.max(error / wish))
