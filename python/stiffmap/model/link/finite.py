"""Displacements too large for a linear field: found by which of the two fits explains the field."""

from __future__ import annotations

import numpy as np

from stiffmap.model.link.arrays import Bools, Floats
from stiffmap.model.link.checks import Field, on_one_line
from stiffmap.model.link.rigidfit import fit_exact, fit_linear, parting_rotation

EVIDENCE = 20.0  # difference of the residual sums in units of the noise variance
MATERIAL = 1e-3  # of the displacement: a smaller misfit of the linear motion is accepted


def finite_rotation(field: Field, kept: Bools) -> str:
    """Why a field turns by more than the linearised rotation (14) can follow; empty where it does not.

    A linear solver's field stays linear at any size, so size alone is no fault: it counts as finite when
    the exact rotation explains the field better beyond noise, by more than 1e-3 of the displacement,
    and the linear estimate is off by a standard error or its noise by 10 %.

    Args:
        field: the checked input; kept: (cases, n) nodes in the fit. All nodes are tried as well,
            since a finite rotation makes the far nodes look like outliers.

    Returns:
        The rotation of the first such case and the rotation at which the two estimates part, in words.
    """
    for k, u in enumerate(field.displacements):
        for nodes in (kept[k], np.ones(kept.shape[1], dtype=bool)):
            if nodes.sum() < 3 or on_one_line(field.points[nodes]):
                continue  # no fit at all; the fit of the nodes that are kept says so
            if found := _finite_case(k, field.points[nodes], u[nodes], field.reference):
                return found
    return ""


def _finite_case(case: int, points: Floats, u: Floats, reference: Floats) -> str:
    linear, exact = fit_linear(points, u, reference), fit_exact(points, u, reference)
    extra, size = linear.rss - exact.rss, float(np.sum(u**2))
    if extra <= MATERIAL**2 * size:
        return ""
    variance = max(exact.rss / max(exact.dof, 1), 1e-26 * size / len(u))
    off = np.abs(linear.twist - exact.twist) / np.sqrt(variance * np.diag(exact.factor))
    if extra > EVIDENCE * variance and (linear.rss > 1.21 * exact.rss or np.max(off) > 1.0):
        phi, sigma = exact.twist[3:], float(np.sqrt(variance))
        limit = parting_rotation(points, reference, sigma, phi)
        return (
            f"displacements: too large for a linear field: case {case} turns by "
            f"{np.linalg.norm(phi):.3g} rad; the linear and the exact fit part at {limit:.2g} rad "
            f'(noise {sigma:.1e} m); scale the loads down or use method="exact"'
        )
    return ""
