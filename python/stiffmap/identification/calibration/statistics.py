"""Linear-Gaussian inference from sums over readings: posterior, evidence, held-out misfit.

With residuals r (N,) whitened to unit noise, and columns A (N, p), their change per standard uncertainty of
each unknown, r = A t + e with t and e standard normal. All that is asked of a set of unknowns depends
on G = AᵀA, b = Aᵀr and rᵀr only; sums over some of the rows are sums of theirs (docs/theory.md (I1)).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular

from stiffmap.experiment.experiment import Floats, Integers, Mask

FELT = 1e-3
"""Singular value below which a direction changes no reading."""
SEEN = 1.0
"""Singular value of A beyond which a direction is determined by the readings more than by its prior."""


@dataclass(frozen=True, eq=False)
class Sums:
    """What N readings say of p unknowns."""

    gram: Floats
    """(p, p) AᵀA."""
    right: Floats
    """(p,) Aᵀr."""
    square: float
    """rᵀr."""
    number: float
    """N less fitted nuisances."""

    @staticmethod
    def of(columns: Floats, residual: Floats, number: float | None = None) -> Sums:
        """Sums of whitened columns (N, p) and residuals (N,)."""
        n = float(len(residual)) if number is None else number
        return Sums(columns.T @ columns, columns.T @ residual, float(residual @ residual), n)

    def __add__(self, other: Sums) -> Sums:
        return Sums(
            self.gram + other.gram,
            self.right + other.right,
            self.square + other.square,
            self.number + other.number,
        )

    def __sub__(self, other: Sums) -> Sums:
        return Sums(
            self.gram - other.gram,
            self.right - other.right,
            self.square - other.square,
            self.number - other.number,
        )

    def pick(self, which: Sequence[int] | Integers) -> Sums:
        """The sums of some unknowns, the others at zero."""
        i = np.asarray(which, dtype=np.intp)
        return Sums(self.gram[np.ix_(i, i)], self.right[i], self.square, self.number)

    def weighed(self, weight: float) -> Sums:
        """The sums of readings that count `weight` times."""
        return Sums(weight * self.gram, weight * self.right, weight * self.square, weight * self.number)

    def scaled(self, factor: Floats) -> Sums:
        """The sums with each standard uncertainty times a factor (p,)."""
        return Sums(self.gram * np.outer(factor, factor), self.right * factor, self.square, self.number)

    @property
    def estimate(self) -> Floats:
        """(p,) posterior mean, in standard uncertainties."""
        p = len(self.right)
        return np.asarray(np.linalg.solve(np.eye(p) + self.gram, self.right)) if p else np.zeros(0)

    @property
    def covariance(self) -> Floats:
        """(p, p) of the posterior, in standard uncertainties."""
        return np.asarray(np.linalg.inv(np.eye(len(self.right)) + self.gram))

    @property
    def singular(self) -> Floats:
        """(p,) singular values of A, largest first."""
        return np.asarray(np.sqrt(np.maximum(np.linalg.eigvalsh(self.gram)[::-1], 0.0)))

    @property
    def rank(self) -> int:
        """Number of directions that the readings determine."""
        return int((self.singular > SEEN).sum())

    @property
    def chi2(self) -> float:
        """Misfit and prior of the best values: rᵀ(I + AAᵀ)⁻¹r."""
        return self.square - float(self.right @ self.estimate)

    @property
    def log_evidence(self) -> float:
        """ln p(r), less the constant that all models of these readings share."""
        if not len(self.right):
            return -0.5 * self.square
        root = cholesky(np.eye(len(self.right)) + self.gram, lower=True, check_finite=False)
        y = solve_triangular(root, self.right, lower=True, check_finite=False)
        return -0.5 * (self.square - float(y @ y)) - float(np.log(np.diag(root)).sum())

    def root(self) -> tuple[Floats, Floats]:
        """(k, p) and (k,): R and y with RᵀR = G and Rᵀy = b, in the k directions that are observable at all."""
        size, vectors = np.linalg.eigh(self.gram)
        felt = size > FELT**2
        r = np.sqrt(size[felt])[:, None] * vectors[:, felt].T
        return r, np.asarray((vectors[:, felt].T @ self.right) / np.sqrt(size[felt]))

    def misfit(self, values: Floats) -> float:
        """|r - A t|² at values t (p,)."""
        return self.square - 2.0 * float(values @ self.right) + float(values @ self.gram @ values)


def directions(columns: Floats) -> Floats:
    """(p, k) orthonormal directions of the unknowns that columns (N, p) feel at all."""
    size, vectors = np.linalg.eigh(columns.T @ columns)
    return np.asarray(vectors[:, size > FELT**2])


def independent(gram: Floats) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """A minimal set of unknowns that spans what the readings determine, and the others.

    Pivoted elimination of AᵀA: the unknown that is most observable comes first and is projected out of the
    others, until what remains of each is below `SEEN`.
    """
    left = np.array(gram, dtype=float)
    kept: list[int] = []
    for _ in range(len(left)):
        size = np.diag(left).copy()
        size[kept] = -np.inf
        best = int(np.argmax(size)) if len(size) else -1
        if best < 0 or not size[best] > SEEN**2:
            break
        kept.append(best)
        left = left - np.outer(left[best], left[best]) / left[best, best]
    rest = [i for i in range(len(left)) if i not in kept]
    return np.array(sorted(kept), dtype=np.intp), np.array(rest, dtype=np.intp)


def gain_of(before: Floats, after: Floats, tests: Sequence[Mask]) -> tuple[float, float]:
    """What the squares of whitened residuals (N,), held out, lose per reading: mean over the folds, standard error."""
    lost = before**2 - after**2
    each = np.array([float(lost[test].mean()) for test in tests if test.any()])
    return float(each.mean()), float(each.std(ddof=1) / np.sqrt(len(each)))
