"""The covariance of what a machine does not explain, of low rank beyond the noise: V = D + F Fᵀ.

Smooth kernels are known by some of the readings (Nyström), blocks of readings that share an error by one column each; what
that leaves of each reading's own variance is noise (Snelson, Ghahramani, NIPS 18 (2006) 1257).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from stiffmap.experiment.experiment import Floats, Mask
from stiffmap.identification.inference.kernels import Kernel, ReadingPoints

MOST_BLOCKS = 600
"""Blocks that have a column, those of most readings first. Effort only."""
ROUND_OFF = 1e-10
"""Of the mean variance: what is added where a kernel cannot be factorised."""


@dataclass(frozen=True, eq=False)
class Covariance:
    """Of N readings, in declared noise."""

    noise: Floats
    """(N,) D."""
    factor: Floats
    """(N, M) F."""

    @cached_property
    def _directions(self) -> tuple[Floats, Floats, Floats]:
        """(N,) D^½, (N, k) orthonormal U and (k,) s² with D^-½ F Fᵀ D^-½ = U diag(s²) Uᵀ."""
        root = np.sqrt(self.noise)
        scaled = self.factor / root[:, None]
        size, vectors = np.linalg.eigh(scaled.T @ scaled)
        kept = size > 1e-12 * max(float(size.max(initial=0.0)), 1.0)
        return root, scaled @ (vectors[:, kept] / np.sqrt(size[kept])), size[kept]

    def white(self, values: Floats) -> Floats:
        """(N, ...) V^-½ values."""
        root, _, size = self._directions
        scaled = (values.reshape(len(root), -1) / root[:, None]) if values.ndim > 1 else values / root
        return self._stretched(1.0 / np.sqrt(1.0 + size), scaled).reshape(values.shape)

    def coloured(self, white: Floats) -> Floats:
        """(N, p) V^½ of whitened values."""
        root, _, size = self._directions
        return np.asarray(root[:, None] * self._stretched(np.sqrt(1.0 + size), white))

    def noise_part(self, white: Floats) -> Floats:
        """(N,) posterior mean of the noise, by whitened readings."""
        root, _, size = self._directions
        return np.asarray(root * self._stretched(1.0 / np.sqrt(1.0 + size), white))

    def _stretched(self, by: Floats, values: Floats) -> Floats:
        """(N,) or (N, p) values, along each of the directions U so many times as long (k,)."""
        u = self._directions[1]
        return np.asarray(values + u @ (((by - 1.0) * (u.T @ values).T).T))

    def only(self, keep: Mask) -> Covariance:
        """Of some readings (N,)."""
        return Covariance(self.noise[keep], self.factor[keep])


def covariance(
    points: ReadingPoints,
    some: ReadingPoints,
    kernels: Sequence[tuple[Kernel, float]],
    noise: Floats,
    more: Floats,
) -> Covariance:
    """Of kernels with their variances, known by some readings; `noise` (N,) and further columns `more` (N, k) of the factor."""
    smooth = [(k, v) for k, v in kernels if k.label is None]
    parts, own = [more], noise.copy()
    if smooth:
        inner = sum((v * k.between(some, some) for k, v in smooth), np.zeros((len(some), len(some))))
        inner[np.diag_indices(len(inner))] += ROUND_OFF * max(float(np.trace(inner)) / len(inner), 1e-300)
        across = sum((v * k.between(some, points) for k, v in smooth), np.zeros((len(some), len(points))))
        found = solve_triangular(cholesky(inner, lower=True), across, lower=True).T
        whole = sum((v * k.own(points) for k, v in smooth), np.zeros(len(points)))
        own += np.maximum(whole - np.sum(found**2, axis=1), 0.0)
        parts.append(found)
    for k, v in kernels:
        if k.label is not None:
            columns = _columns(k.label(points))
            parts.append(np.sqrt(v * k.own(points))[:, None] * columns)
            own += v * k.own(points) * (1.0 - columns.sum(axis=1))
    return Covariance(own, np.hstack(parts))


def _columns(label: np.ndarray[tuple[int, ...], np.dtype[np.intp]]) -> Floats:
    """(N, k) one where a reading is in a block of several."""
    _, number, count = np.unique(label, return_inverse=True, return_counts=True)
    chosen = [b for b in np.argsort(-count, kind="stable")[:MOST_BLOCKS] if count[b] > 1]
    return np.asarray(number.reshape(-1)[:, None] == np.array(chosen, dtype=np.intp), dtype=float)
