"""Mesh refinement: observed order and Richardson estimate of a compliance with an error bar."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from stiffmap.common.errors import StiffmapError
from stiffmap.model.link.transport import Floats

PLAUSIBLE = (0.5, 5.0)  # an order outside is not believed; order one is then assumed


class Refinement(NamedTuple):
    """Extrapolation of a (6, 6) compliance over three or more meshes."""

    sizes: Floats  # (meshes,) m, coarse to fine
    order: float  # observed order of the trace of the scaled compliance; NaN when there is none
    estimate: Floats  # (6, 6) extrapolated to size zero
    error: Floats  # (6, 6) standard uncertainty of the finest mesh's compliance against size zero
    why: str = ""  # why the order is not believed; empty when it is

    @property
    def words(self) -> str:
        """The observed order, or why there is none."""
        return self.why or f"{self.order:.2f}"


def observed_order(sizes: Floats, values: Floats) -> float:
    """Order p in ``v = v0 + c h^p`` through the three finest meshes, link (14); NaN when not monotone.

    Args:
        sizes: (m >= 3,) m, coarse to fine; values: (m,).
    """
    h, v = sizes[-3:], values[-3:]
    first, second = v[1] - v[0], v[2] - v[1]
    if first * second <= 0:
        return float("nan")

    def gap(p: float) -> float:
        return float((h[0] ** p - h[1] ** p) / (h[1] ** p - h[2] ** p) - first / second)

    low, high = 1e-3, 20.0
    return float(brentq(gap, low, high)) if gap(low) * gap(high) < 0 else float("nan")


def richardson(sizes: Floats, compliances: Floats) -> Refinement:
    """Extrapolate compliances (m, 6, 6) over meshes of these sizes (m,) m, coarse to fine.

    One order is taken from the trace scaled by the finest diagonal, since single small entries are
    not monotone. The error is the extrapolated step; with two meshes only, or where the order is not
    plausible, the step that order one would give, and no extrapolation.

    Raises:
        StiffmapError: fewer than two meshes, or sizes that do not fall.
    """
    if len(sizes) < 2 or np.any(np.diff(sizes) >= 0):
        raise StiffmapError(f"refinement: expected at least two falling mesh sizes, got {np.asarray(sizes)}")
    scale = np.diag(compliances[-1])
    trace = np.array([np.sum(np.diag(C) / scale) for C in compliances])
    p = observed_order(sizes, trace) if len(sizes) > 2 else float("nan")
    change = compliances[-1] - compliances[-2]
    if not PLAUSIBLE[0] <= p <= PLAUSIBLE[1]:
        error = np.abs(change) / (sizes[-2] / sizes[-1] - 1)
        return Refinement(sizes, p, compliances[-1], error, _why(sizes, trace, p))
    step = change / ((sizes[-2] / sizes[-1]) ** p - 1)
    return Refinement(sizes, p, compliances[-1] + step, np.abs(step))


def _why(sizes: Floats, trace: Floats, order: float) -> str:
    """Why the order is not believed, and what is done instead."""
    if len(sizes) < 3:
        reason = "only two meshes differ in size"
    elif np.isnan(order):
        steps = ", ".join(f"{step:+.1e}" for step in np.diff(trace[-3:]) / trace[-1])
        reason = f"the meshes' trace changes by {steps} of itself, which no order explains"
    else:
        reason = f"{order:.2f} is outside {PLAUSIBLE[0]:g} to {PLAUSIBLE[1]:g}"
    return f"none ({reason}); order one is assumed"
