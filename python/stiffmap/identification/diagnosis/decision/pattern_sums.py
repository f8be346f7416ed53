"""What patterns of many columns take away, from the products of the columns: none is whitened by itself.

Whitened columns have the products D - A Aᵀ, D of the columns over the noise of each reading and A of the columns with the few
directions (nuisances, uncertain numbers, effects) that are taken out.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from stiffmap.experiment.experiment import Floats, Integers
from stiffmap.experiment.noise.whitening import Problem, readings_of

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
