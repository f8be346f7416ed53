"""The readings of an experiment as one whitened vector, nuisances projected out.

Generalised least squares: with the covariance V = L Lᵀ of the readings (independent noise, plus the
zero that the readings of one pose share) everything is multiplied by L⁻¹, and the nuisances (unknown
frame, unknown zero of a pose) are projected out once and for all. What is left is unit white noise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Floats, Integers, Mask
from stiffmap.experiment.noise.nuisance import nuisance_columns
from stiffmap.experiment.noise.robust import ROUNDS, fitted


@dataclass(frozen=True, eq=False)
class LinearProblem:
    """Kept readings, in the order of rows and axes; N of them."""

    experiment: Experiment
    sigma: Floats
    """(n, c) noise floor of each reading."""
    keep: Mask
    """(n,) rows in use."""
    index: tuple[Integers, Integers]
    """Row and axis of each of the N readings."""
    nuisance: Floats
    """(N, q) orthonormal basis of the whitened nuisances."""
    blocks: tuple[tuple[Integers, Floats], ...]
    """Readings that share a zero, and the inverse Cholesky factor of their covariance."""
    base: Floats
    """(n, c) prediction of the declared machine."""

    @staticmethod
    def of(experiment: Experiment, sigma: Floats, base: Floats, keep: Mask | None = None) -> LinearProblem:
        """Problem of the rows in `keep`; `base` (n, c) is the declared machine's prediction."""
        rows = np.ones(len(experiment), bool) if keep is None else keep
        at, axis = readings_of(experiment, base)
        index = (at[rows[at]], axis[rows[at]])
        none = np.zeros((len(index[0]), 0))
        bare = LinearProblem(experiment, sigma, rows, index, none, _blocks(experiment, sigma, index), base)
        columns = nuisance_columns(experiment, base)
        if columns.shape[-1]:
            bare = replace(bare, nuisance=basis(bare.white(columns)))
        return bare

    def __len__(self) -> int:
        return len(self.index[0])

    @property
    def freedom(self) -> int:
        """Readings minus nuisances."""
        return len(self) - int(self.nuisance.shape[1])

    @property
    def groups(self) -> Integers:
        """(N,) pose number of each reading."""
        return self.experiment.groups[self.index[0]]

    def white(self, values: Floats) -> Floats:
        """(n, c, ...) -> (N, ...): whitened, nuisances projected out."""
        return self._white(values[self.index])

    def white_lines(self, lines: Floats) -> Floats:
        """(P, R) -> (N, P): the same of all readings of the experiment, in the order of `readings_of`, one set per line."""
        return self._white(lines.T if self.used.all() else lines[:, self.used].T)

    def _white(self, picked: Floats) -> Floats:
        out = picked / self.sigma[self.index].reshape(-1, *(1,) * (picked.ndim - 1))
        for where, inverse in self.blocks:
            out[where] = inverse @ picked[where]
        return np.asarray(out - self.nuisance @ (self.nuisance.T @ out))

    @cached_property
    def used(self) -> Mask:
        """(R,) which of all readings of the experiment are in the problem."""
        return np.asarray(self.keep[readings_of(self.experiment, self.base)[0]])

    def check(self, prediction: Floats) -> Floats:
        """The prediction; StiffmapError where a pose that the problem reads could not be solved."""
        failed = np.isnan(prediction[self.index])
        if failed.any():
            rows = np.unique(self.index[0][failed])
            first = self.experiment.ids[int(rows[0])]
            raise StiffmapError(
                f"{len(rows)} rows of the experiment have no equilibrium, the first is '{first}'"
            )
        return prediction

    def residual(self, prediction: Floats) -> Floats:
        """(N,) whitened reading minus prediction; StiffmapError where a pose that it reads failed."""
        return self.white(self.experiment.reading - self.check(prediction))


def readings_of(experiment: Experiment, base: Floats) -> tuple[Integers, Integers]:
    """Row and axis of all R readings of an experiment that the declared machine's prediction (n, c) covers."""
    at, axis = np.nonzero(experiment.read & np.isfinite(base))
    return at.astype(np.intp), axis.astype(np.intp)


def nuisance_part(problem: LinearProblem, values: Floats, *, robust: bool = False) -> Floats:
    """(n, c) what the nuisances of best fit say of `values` (n, c); NaN where they are."""
    return best_fit(problem, nuisance_columns(problem.experiment, problem.base), values, robust=robust)


def best_fit(problem: LinearProblem, columns: Floats, values: Floats, *, robust: bool = False) -> Floats:
    """(n, c) what columns (n, c, q) of best fit to the kept readings say of `values` (n, c), nothing else fitted; `robust`:
    readings that are far off do not count."""
    if not columns.shape[-1]:
        return np.zeros(values.shape)  # no memory until it is written to
    bare = replace(problem, nuisance=np.zeros((len(problem), 0)))
    rounds = ROUNDS if robust else 1
    return np.asarray(columns @ fitted(bare.white(columns), bare.white(np.nan_to_num(values)), rounds)[0])


def basis(columns: Floats, tolerance: float = 1e-9) -> Floats:
    """Orthonormal basis of the span of columns (N, p), p ≥ rank."""
    if not columns.shape[1]:
        return columns
    norms = np.linalg.norm(columns, axis=0)
    u, s, _ = np.linalg.svd(columns / np.where(norms > 0, norms, 1.0), full_matrices=False)
    return np.asarray(u[:, s > tolerance])


def _blocks(
    experiment: Experiment, sigma: Floats, index: tuple[Integers, Integers]
) -> tuple[tuple[Integers, Floats], ...]:
    zero, width = experiment.zeros, len(experiment.channels)
    if experiment.quantity != "deflection" or not zero.any():
        return ()
    out = []
    key = experiment.groups[index[0]] * width + index[1]
    for k in np.unique(key):
        where = np.flatnonzero(key == k)
        s = zero[k % width]
        if s > 0:
            v = np.diag(sigma[index][where] ** 2) + s**2
            out.append((where, np.linalg.inv(np.linalg.cholesky(v))))
    return tuple(out)
