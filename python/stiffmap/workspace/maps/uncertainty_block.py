"""The uncertainty of one block of a map's poses."""

from __future__ import annotations

from typing import Any

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.solution import Solution
from stiffmap.workspace.maps.direction_sweep import direction
from stiffmap.workspace.maps.fixed_order_sums import norm
from stiffmap.workspace.maps.loading import Loading, without_failed
from stiffmap.workspace.maps.plan import MapPlan
from stiffmap.workspace.maps.uncertainty import Uncertain

ALL = (0, 1, 2)


def load_deviations(plan: MapPlan, uncertain: Uncertain, position: Floats) -> dict[str, Any]:
    """Standard deviations under the load cases, at positions (poses, 3)."""
    s, j = sensitivities(plan.loading, uncertain, position[:, None], plan.wrenches)
    d = without_failed(s.displacement, s.status)
    std, parts = deviation(j, d, ALL, uncertain.covariance)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = parts / (std**2)[..., None]
    return {
        "displacement_std": np.sqrt(_variance(j, uncertain.covariance)),
        "deflection_std": std,
        f"deflection_{plan.shown_plane}_std": deviation(j, d, plan.axes, uncertain.covariance)[0],
        "variance_share": share,
    }


def worst_deviations(
    plan: MapPlan, uncertain: Uncertain, position: Floats, extremes: dict[str, Any]
) -> dict[str, Any]:
    """Standard deviation of the deflection in the worst direction.

    The direction itself moves with the numbers, but that adds nothing to first order: it is an extremum.
    """
    out = {}
    for suffix, parts in (("", ALL), (f"_{plan.shown_plane}", plan.axes)):
        along = direction(np.nan_to_num(extremes[f"worst_direction{suffix}"]), plan.axes)
        wrench = np.concatenate([plan.force * along, np.zeros_like(along)], axis=-1)
        s, j = sensitivities(plan.loading, uncertain, position, wrench)
        std = deviation(j, without_failed(s.displacement, s.status), parts, uncertain.covariance)[0]
        failed = np.isnan(extremes[f"worst_deflection{suffix}"])
        out[f"worst_deflection{suffix}_std"] = np.where(failed, np.nan, std)
    return out


def sensitivities(
    loading: Loading, uncertain: Uncertain, position: Floats, wrench: Floats
) -> tuple[Solution, Floats]:
    """Equilibria (...) and the derivatives (..., P, 6) of their displacement; NaN where a pose failed."""
    s, varied = loading.solve_varied(position, wrench, uncertain.machines)
    slope = (varied[..., 1::2, :] - varied[..., 0::2, :]) / (2 * uncertain.steps[:, None])
    return s, without_failed(slope, s.status)


def deviation(j: Floats, d: Floats, parts: tuple[int, ...], covariance: Floats) -> tuple[Floats, Floats]:
    """Standard deviation (...) of the norm of the components `parts`, and its variance by number (..., P).

    A number's part is its own variance and half of what it shares with each correlated one. NaN where the
    deflection is zero and uncertain: its norm has no slope there.
    """
    size = norm(d[..., parts])
    with np.errstate(invalid="ignore", divide="ignore"):
        unit = d[..., parts] / size[..., None]
    slope = np.einsum("...pk,...k->...p", j[..., parts], unit)
    still = (size == 0) & ~np.any(j[..., parts], axis=(-2, -1))
    slope = np.where(still[..., None], 0.0, slope)
    shares = slope * np.einsum("pq,...q->...p", covariance, slope)
    return np.sqrt(np.maximum(shares.sum(axis=-1), 0.0)), shares


def _variance(j: Floats, covariance: Floats) -> Floats:
    return np.asarray(np.maximum(np.einsum("...pk,pq,...qk->...k", j, covariance, j), 0.0))
