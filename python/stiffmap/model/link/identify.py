"""The identification of a link's spring: section 4.2 of the paper, step by step (docs/link.md)."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats, Mask, real_array
from stiffmap.common.errors import StiffmapError
from stiffmap.model.link.checks import (
    DisplacementField,
    check_points,
    checked_field,
    identifiable_columns,
    on_one_line,
)
from stiffmap.model.link.noise import Correlation, FieldNoise, analyse_correlation, estimate_noise
from stiffmap.model.link.outliers import LEVEL, find_outliers
from stiffmap.model.link.regression import regress
from stiffmap.model.link.result import Evidence, Link, build_link
from stiffmap.model.link.rigidfit import RigidFit, fit_exact, fit_linear, parting_rotation, turn_back
from stiffmap.model.link.transport import twist_transport

Known = float | ArrayLike | Literal["independent"] | None
FITS = {"linear": fit_linear, "exact": fit_exact}
ROUND_OFF = 1e-14  # of the largest displacement: below it a residual is arithmetic, not noise


def identify_link(
    points: ArrayLike,
    displacements: ArrayLike,
    wrenches: ArrayLike,
    *,
    reference: ArrayLike,
    noise: Known = None,
    method: Literal["auto", "linear", "exact"] = "auto",
    symmetric: bool = True,
    zeros: Literal["report", "apply"] = "report",
    level: float = 0.05,
    outliers: bool = True,
    partial: bool = False,
) -> Link:
    """6x6 spring of a link, with its uncertainty, from the displacement field near its loaded end.

    Args:
        points: (n, 3) m, nodes near the reference point, link axes.
        displacements: (cases, n, 3) m.
        wrenches: (cases, 6) N, N·m at `reference`: dead loads on the link, link axes.
        reference: (3,) m, the point where the spring sits.
        noise: None estimates the noise from the residuals and tests whether it is independent;
            "independent" skips that test; a number or (cases,) numbers in m are a known noise.
        method: "linear" for a linear solver's field (eq. 14, 15), "exact" for one with finite rotations; "auto" takes
            "exact" where the field shows that it turns by more than the linear fit can follow.
        symmetric: re-estimate under symmetry (`raw` keeps the estimate before).
        zeros: "apply" re-estimates with the insignificant entries at zero.
        level: family-wise level of the zero test.
        outliers: remove nodes that do not move with the body.
        partial: accept wrenches of rank below six; what they do not show is NaN.

    Raises:
        StiffmapError: shapes, NaN, fewer than three or collinear points, wrenches of rank below six,
            displacements too large for a linear field where method="linear" was asked for.
    """
    field = checked_field(points, displacements, wrenches, reference)
    known = known_noise(noise, len(field.wrenches))
    columns = identifiable_columns(field.wrenches, partial=partial)
    found = "exact" if method == "exact" else "linear"
    kept = ~_outliers(field, known, outliers, found)
    if found == "linear" and (too_large := finite_rotation(field, kept)):
        if method == "linear":
            raise StiffmapError(too_large)
        found = "exact"
        kept = ~_outliers(field, known, outliers, found)
    fits = [_fit(field, k, kept[k], found) for k in range(len(kept))]
    estimate = _noise(field, fits, known)
    correlation = _correlation(field, kept, noise, found)
    covariances = _twist_covariances(field, kept, fits, estimate, correlation)
    regression = regress(field.wrenches, np.array([f.twist for f in fits]), covariances)
    evidence = Evidence(
        field, kept, tuple(fits), estimate, correlation, covariances, regression, columns, found
    )
    link = build_link(evidence, symmetric=symmetric, level=level)
    return link.with_zeros() if zeros == "apply" else link


def known_noise(noise: Known, cases: int) -> Floats | None:
    """(cases,) m of a noise given as a number or per case; None when it is to be estimated.

    Raises:
        StiffmapError: not positive finite numbers, one or one per case.
    """
    if noise is None or (isinstance(noise, str) and noise == "independent"):
        return None
    try:
        sigma = real_array(noise, "noise")
    except (TypeError, ValueError):
        sigma = np.array([np.nan])
    if sigma.shape not in {(), (1,), (cases,)} or not np.all(np.isfinite(sigma)) or not np.all(sigma > 0):
        raise StiffmapError(
            f'noise: expected None, "independent", or one or {cases} positive numbers in m, got {noise!r}'
        )
    return np.asarray(np.broadcast_to(sigma, (cases,)))


def _outliers(field: DisplacementField, known: Floats | None, wanted: bool, method: str) -> Mask:
    found = np.zeros(field.displacements.shape[:2], dtype=bool)
    if wanted:
        for k, u in enumerate(field.displacements):
            small = turn_back(field.points, u) if method == "exact" else u
            found[k] = find_outliers(
                field.points, small, LEVEL / len(found), None if known is None else float(known[k])
            )
    return found


def _fit(field: DisplacementField, case: int, kept: Mask, method: str) -> RigidFit:
    points = field.points[kept]
    check_points(points)
    return FITS[method](points, field.displacements[case, kept], field.reference)


def _noise(field: DisplacementField, fits: list[RigidFit], known: Floats | None) -> FieldNoise:
    rss, dof = np.array([f.rss for f in fits]), np.array([f.dof for f in fits], dtype=np.int64)
    size = np.abs(field.displacements).max(axis=(1, 2))
    floor = ROUND_OFF * np.where(size > 0, size, size.max(initial=1e-300))
    noise = estimate_noise(rss, dof, np.maximum(floor, 1e-300))
    if known is None:
        return noise
    return noise._replace(used=known, used_dof=np.full(len(known), np.inf), pooled=False)


def _correlation(field: DisplacementField, kept: Mask, noise: Known, method: str) -> Correlation | None:
    """Correlation of the residuals on the nodes that every case keeps; None when not asked for."""
    common = kept.all(axis=0)
    if noise is not None or common.sum() < 12:
        return None
    p = field.points[common]
    residuals = [FITS[method](p, u[common], field.reference).residual for u in field.displacements]
    size = np.abs(field.displacements).max(axis=(1, 2), keepdims=True)
    r = np.array(residuals)
    # Round-off of an exactly rigid field is not a field of noise.
    return analyse_correlation(p, np.where(np.abs(r).max(axis=(1, 2), keepdims=True) > 1e-12 * size, r, 0.0))


def _twist_covariances(
    field: DisplacementField,
    kept: Mask,
    fits: list[RigidFit],
    noise: FieldNoise,
    correlation: Correlation | None,
) -> Floats:
    """(cases, 6, 6): sigma² times (19), inflated for correlated noise at the centroid, at the reference."""
    out = np.empty((len(fits), 6, 6))
    for k, fit in enumerate(fits):
        out[k] = noise.used[k] ** 2 * fit.factor
        if correlation is not None and correlation.correlated:
            T = twist_transport(field.reference - field.points[kept[k]].mean(axis=0))
            back = np.linalg.inv(T)
            root = np.sqrt(correlation.inflation)
            out[k] = T @ (np.outer(root, root) * (back @ out[k] @ back.T)) @ T.T
    return out


EVIDENCE = 20.0  # difference of the residual sums in units of the noise variance
MATERIAL = 1e-3  # of the displacement: a smaller misfit of the linear motion is accepted


def finite_rotation(field: DisplacementField, kept: Mask) -> str:
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
