"""The readings of an experiment as one whitened vector, nuisances projected out, and what these are in rows held out.

Generalised least squares: with the covariance V = L Lᵀ of the readings (independent noise, plus the
zero that the readings of one pose share) everything is multiplied by L⁻¹, and the nuisances (unknown
frame, unknown zero of a pose) are projected out once and for all. What is left is unit white noise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from stiffmap.common.broadcasting import Mask, random_numbers
from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Floats, Integers
from stiffmap.experiment.noise.nuisance import nuisance_columns

FOLDS, MANY_RUNS = 5, 4
"""Groups of poses, and set-ups from which on these are left out whole: a machine is judged by what nearly all readings give."""
DEGREES = 1.0
"""Of freedom: readings far off have no weight at all."""
ROUNDS, SETTLED = 50, 1e-3
"""Fits, and change of weights that ends them."""
LEAST = 1e-9
"""Share of the largest reading that is no spread."""
MOST = 100
"""Columns up to which a fit is robust; a zero of each of many poses is fitted plainly."""


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


def fitted(columns: Floats, values: Floats, rounds: int = ROUNDS) -> tuple[Floats, Floats]:
    """(p,) coefficients of columns (N, p) for values (N,) in noise, and (N,) what they leave in robust standard deviations, which
    are at least the noise; one round is plain least squares."""
    size = np.linalg.norm(columns, axis=0)
    scaled = columns / np.where(size > 0.0, size, 1.0)
    weights: Floats = np.ones(len(values))
    found: Floats = np.zeros(columns.shape[1])
    left, scale = values, 1.0
    for _ in range(rounds if columns.shape[1] <= MOST else 1):
        root = np.sqrt(weights)
        found = np.asarray(np.linalg.lstsq(scaled * root[:, None], values * root, rcond=1e-9)[0])
        left = np.abs(values - scaled @ found)
        spread = 1.4826 * float(np.median(left)) if len(left) else 1.0
        scale = max(spread, LEAST * np.abs(values).max(initial=0.0), 1.0)
        moved = (DEGREES + 1.0) / (DEGREES + (left / scale) ** 2)
        if np.abs(moved - weights).max(initial=0.0) < SETTLED:
            break
        weights = np.asarray(moved)
    return found / np.where(size > 0.0, size, 1.0), left / scale


def folds(experiment: Experiment, seed: int) -> tuple[Integers, str]:
    """(n,) fold of every row: whole set-ups where there are `MANY_RUNS` or more, else whole poses."""
    if experiment.runs.max() + 1 >= MANY_RUNS:
        return experiment.runs, "set-ups"
    number = int(experiment.groups.max()) + 1
    label = random_numbers(seed).permutation(number) % min(FOLDS, number)
    return label[experiment.groups], "poses"


def left_unseen(e: Experiment, sigma: Floats, prediction: Floats, seen: Mask, unseen: Mask) -> Floats:
    """(n, c) reading minus prediction (n, c) at noise `sigma` (n, c), less the nuisances of rows `unseen` (n,) as those in
    `seen` (n,) determine them. What frames and tools change is taken at the prediction."""
    others, own = (LinearProblem.of(e, sigma, prediction, rows) for rows in (seen, unseen))
    left = e.reading - prediction
    return np.asarray(left - unseen_nuisances(others, own, left))


def unseen_nuisances(others: LinearProblem, own: LinearProblem, values: Floats) -> Floats:
    """(n, c) what nuisances say of `values` (n, c) where the readings of `own` are held out: as the readings of `others`
    determine them; those that none of `others` knows (the frame of another set-up, the zero of another pose) as their
    own readings do."""
    columns = nuisance_columns(others.experiment, others.base)
    known = np.abs(np.nan_to_num(columns[others.index])).max(axis=0, initial=0.0) > 0.0
    said = best_fit(others, columns[..., known], values)
    return np.asarray(said + best_fit(own, columns[..., ~known], values - said))
