"""Structure that is left: smooth or periodic patterns in the residual that need no physical name.

Generic patterns (trends over the workspace, over force, order, temperature, branch; waves along the
coordinates; offsets of single poses) are tested against the whitened residual like candidates are.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np
from scipy.sparse import csr_array
from scipy.stats import chi2

from stiffmap.experiment.experiment import Floats, Integers
from stiffmap.experiment.noise.field import free_position, unit
from stiffmap.experiment.noise.whitening import Problem, basis, readings_of
from stiffmap.identification.diagnosis.search.significance import ALPHA

WIDE = 1_000_000
"""Numbers in the columns of a pattern beyond which only their products are made."""


@dataclass(frozen=True)
class Pattern:
    """A pattern in the residual of one axis: its p-value, and its share of the excess."""

    axis: str
    what: str
    p: float
    """p-value, corrected for all patterns tried."""
    removed: float
    """Drop of chi-square."""
    detail: str = ""
    """Period, step or slope, in words with units."""
    position: tuple[float, float, float] | None = None
    """Commanded position of the pose where the axis is worst, m."""
    size: float = float("nan")
    """rms of what is left there, m or rad."""


def patterns(problem: Problem, residual: Floats, tangent: Floats) -> list[Pattern]:
    """Significant patterns, those first that explain most by least; `residual` (N,) and `tangent` (N, k)
    whitened."""
    tested = [
        (axis, name, *_reduction(problem, residual, tangent, axis, columns))
        for name, columns in features(problem)
        for axis in range(len(problem.experiment.channels))
        if problem.experiment.read[:, axis].any()
    ]
    number = len(tested)
    price = float(np.log(max(len(problem), 2)))
    tested.sort(key=lambda t: t[3] * price - t[2])
    out = [
        Pattern(
            problem.experiment.channels[axis].name,
            name,
            float(min(1.0, number * chi2.sf(delta_chi2, max(rank, 1)))),
            float(delta_chi2),
        )
        for axis, name, delta_chi2, rank in tested
    ]
    return [p for p in out if p.p < ALPHA]


def _reduction(
    problem: Problem, residual: Floats, tangent: Floats, axis: int, columns: Floats | Integers
) -> tuple[float, int]:
    """Drop of chi-square and rank of columns (n, p), or of one for each of the labels (n,), on an axis."""
    number = columns.max() + 1 if columns.ndim == 1 else columns.shape[1]
    if number * len(problem) > WIDE and not problem.blocks:
        return reduction_by_sums(problem, residual, tangent, axis, columns)
    if columns.ndim == 1:
        columns = np.eye(number)[columns]
    on_axis = np.zeros((columns.shape[1], *problem.sigma.shape))
    on_axis[:, :, axis] = columns.T
    white = np.column_stack([problem.white(c) for c in on_axis])
    if tangent.shape[1]:
        white = white - tangent @ (tangent.T @ white)
    q = basis(white, 1e-6)
    return float(np.sum((q.T @ residual) ** 2)), q.shape[1]


def features(problem: Problem) -> Iterator[tuple[str, Floats | Integers]]:
    """Name and (n, p) columns of every pattern, or (n,) labels of rows that each have a column of their own."""
    e = problem.experiment
    x = unit(free_position(e))
    n = len(e)
    yield "constant", np.ones((n, 1))
    yield "linear trend over the workspace", x
    yield "quadratic trend over the workspace", powers(x, 2)
    yield "cubic trend over the workspace", powers(x, 3)
    for a, name in enumerate("xyz"):
        if np.ptp(x[:, a]) > 0 and np.ptp(e.position[:, a]) > 0:
            yield f"waves along {name}", waves(x[:, a])
    if e.wrench.any():
        yield from loads(e.wrench, x)
    for name, series in (("order", e.order), ("temperature", e.temperature)):
        if series is not None and np.ptp(series) > 0:
            t = unit(series[:, None])
            yield f"trend with {name}", np.hstack([t, t**2, t**3])
            yield f"waves over {name}", waves(t[:, 0])
    if e.branch:
        yield "branch", np.array([b == "unloading" for b in e.branch], dtype=float)[:, None]
    if e.setup:
        labels = np.unique(e.setup, return_inverse=True)[1]
        yield "set-ups", labels.reshape(-1)
    yield "single poses", e.groups


def loads(wrench: Floats, x: Floats) -> Iterator[tuple[str, Floats]]:
    """Patterns in the load: linear, size, cube, sign, each also changing over the workspace."""
    w = wrench[:, wrench.any(axis=0)]
    w = w / np.abs(w).max(axis=0)
    there = np.hstack([np.ones((len(x), 1)), x])
    kinds = {
        "force": w,
        "size of the force": np.abs(w),
        "cube of the force": w**3,
        "sign of the force": np.sign(w),
    }
    for name, f in kinds.items():
        yield f"proportional to {name}", f
        yield f"proportional to {name}, changing over the workspace", _products(f, there)
    yield (
        "proportional to force, quadratic over the workspace",
        _products(w, np.hstack([there, powers(x, 2)])),
    )


def _products(a: Floats, b: Floats) -> Floats:
    return np.asarray((a[:, :, None] * b[:, None, :]).reshape(len(a), -1))


def powers(x: Floats, degree: int) -> Floats:
    """(n, p) products of `degree` coordinates."""
    return np.column_stack(
        [np.prod(x[:, list(c)], axis=1) for c in combinations_with_replacement(range(x.shape[1]), degree)]
    )


def waves(x: Floats, most: int = 6) -> Floats:
    """(n, 2 most) sines and cosines with 1 … `most` half waves over [-1, 1]."""
    k = np.arange(1, most + 1) * np.pi / 2
    return np.hstack([np.sin(x[:, None] * k), np.cos(x[:, None] * k)])


# What patterns of many columns take away, from the products of the columns: none is whitened by itself.
#
# Whitened columns have the products D - A Aᵀ, D of the columns over the noise of each reading and A of the columns with the few
# directions (nuisances, uncertain numbers, effects) that are taken out.

FLAT = 1e-10
"""Eigenvalue of the products of columns of length one that counts as none."""


def reduction_by_sums(
    problem: Problem, residual: Floats, tangent: Floats, axis: int, columns: Floats | Integers
) -> tuple[float, int]:
    """Drop of chi-square and rank of columns (n, p) on an axis; or of one for each of the labels (n,), which are many.

    No readings may share a zero; `residual` (N,) and `tangent` (N, k) are whitened.
    """
    rows, axes = readings_of(problem.experiment, problem.base)
    here = np.flatnonzero(axes == axis)
    own = columns[rows[here]]
    weight = problem.precision[here]
    parts = [problem.unwhite(d)[here] * np.sqrt(s) for d, s in problem.projections]
    out = np.hstack([*parts, problem.adjoint(tangent)[here]])
    left = problem.adjoint((residual - tangent @ (tangent.T @ residual))[:, None])[here, 0]
    if own.ndim == 1:
        return _of_labels(own.astype(np.intp), weight, out, left, int(columns.max()) + 1)
    a = own.T @ out
    gram = own.T @ (own * weight[:, None]) - a @ a.T
    size = np.sqrt(np.maximum(np.diagonal(gram), 0.0))
    unit = np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(gram / unit / unit[:, None])
    seen = values > FLAT
    along = vectors[:, seen].T @ (own.T @ left / unit) / np.sqrt(values[seen])
    return float(along @ along), int(seen.sum())


def _of_labels(labels: Integers, weight: Floats, out: Floats, left: Floats, count: int) -> tuple[float, int]:
    """Columns that share no reading: D is diagonal, and I - BBᵀ is inverted by the few directions of B."""
    sums = csr_array((np.ones(len(labels)), (labels, np.arange(len(labels)))), shape=(count, len(labels)))
    size = np.sqrt(sums @ weight)
    there = size > 0
    right = (sums @ left)[there] / size[there]
    u, s, _ = np.linalg.svd((sums @ out)[there] / size[there, None], full_matrices=False)
    rest = 1.0 - s**2
    seen = rest > FLAT
    along = u.T @ right
    drop = right @ right - along @ along + np.sum(along[seen] ** 2 / rest[seen])
    return float(drop), int(there.sum()) - int(np.sum(~seen))
