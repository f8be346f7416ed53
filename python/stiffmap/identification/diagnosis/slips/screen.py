"""Screening: how much of the residual each candidate's sensitivities can take away.

All candidates at once: their whitened columns, freed of nuisances and of the effects that are already
in the model, are orthonormalised through their Gram matrices; the reduction of chi-square is then the squared projection.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.noise.whitening import Problem
from stiffmap.identification.candidates.sensitivity import Variant
from stiffmap.identification.candidates.stack import Stack

VISIBLE = 0.03
"""Whitened length per scale below which a parameter is not seen: 100 scales would make 3 sigma."""
RANK = 1e-5
FREED = 1e-3
"""Share of a column's length below which a model's directions leave nothing of it."""


@dataclass(frozen=True, eq=False)
class Screen:
    """The columns of all variants under a problem, and what makes them orthogonal to a model. Whitened columns are
    made where they are asked for, and never kept."""

    problem: Problem
    stack: Stack
    grams: tuple[Floats, ...]
    """Per part: (V_p, p, p) products of the whitened columns of each variant; zero where the readings don't feel them."""
    tangent: Floats
    """(N, k) orthonormal directions of the model."""
    along: tuple[Floats, ...]
    """Per part: (V_p, p, k) the columns along the model's directions; what counts is the rest of them."""
    roots: tuple[Floats, ...]
    """Per part: (V_p, p, p) M: the rest of the columns times M is orthonormal, zero where the rank is less than p."""
    sizes: tuple[Floats, ...]
    """Per part: (V_p, p) length of the rest of each column."""
    rank: NDArray[np.intp]
    """(V,) number of directions that are seen; 0: nothing."""

    @staticmethod
    def of(problem: Problem, stack: Stack) -> Screen:
        """Screen of the variants with an empty model."""
        grams = tuple(_felt(p.gram(problem)) for p in stack.parts)
        return _screen(problem, stack, grams, np.zeros((len(problem), 0)))

    def beside(self, tangent: Floats) -> Screen:
        """The screen with the directions `tangent` (N, k), orthonormal, of a model projected out."""
        return _screen(self.problem, self.stack, self.grams, tangent) if tangent.size else self

    @property
    def variants(self) -> tuple[Variant, ...]:
        """All of them."""
        return self.stack.variants

    @property
    def readings(self) -> int:
        """N."""
        return int(self.tangent.shape[0])

    def basis(self, i: int) -> Floats:
        """(N, rank) orthonormal columns of variant i."""
        g, k = self.stack.place(i)
        root = self.roots[g][k]
        return np.asarray(self.columns(i) @ root[:, np.any(root != 0.0, axis=0)])

    def columns(self, i: int) -> Floats:
        """(N, p) whitened columns of variant i, freed of the model's directions."""
        g, k = self.stack.place(i)
        white = self.problem.white_lines(self.stack.parts[g].line(k))
        rest = white - self.tangent @ self.along[g][k].T
        return np.asarray(np.where(np.any(self.roots[g][k] != 0.0, axis=1), rest, 0.0))

    def delta_chi2(self, residual: Floats) -> Floats:
        """(V, S) reduction of chi-square of each variant for residuals (N, S); nothing for one-parameter
        effects that would have to grow backwards."""
        out = np.zeros((len(self.variants), residual.shape[1]))
        rest = self.problem.adjoint(residual - self.tangent @ (self.tangent.T @ residual))
        for m, part, root in zip(self.stack.members, self.stack.parts, self.roots, strict=True):
            along = part.along(rest)
            reduction = ((root.transpose(0, 2, 1) @ along) ** 2).sum(axis=1)
            if along.shape[1] == 1:
                sign = np.array([self.variants[i].sign[0] for i in m])
                reduction = np.where(along[:, 0] * sign[:, None] >= 0, reduction, 0.0)
            out[m] = reduction
        return out

    def estimate(self, i: int, residual: Floats) -> Floats:
        """(p,) least-squares values of variant i in units of the parameters' scales."""
        return np.asarray(np.linalg.lstsq(self.columns(i), residual, rcond=RANK)[0])


def _felt(gram: Floats) -> Floats:
    """(V, p, p) without the columns that the readings don't feel."""
    felt = np.sqrt(np.maximum(np.diagonal(gram, axis1=1, axis2=2), 0.0)) > VISIBLE
    return np.asarray(gram * felt[:, :, None] * felt[:, None, :])


def _screen(problem: Problem, stack: Stack, grams: tuple[Floats, ...], tangent: Floats) -> Screen:
    rank = np.zeros(len(stack.variants), dtype=np.intp)
    alongs, roots, sizes = [], [], []
    back = problem.adjoint(tangent)
    for m, part, whole in zip(stack.members, stack.parts, grams, strict=True):
        before = np.diagonal(whole, axis1=1, axis2=2)
        along = part.along(back) * (before > 0.0)[:, :, None]
        gram = whole - along @ along.transpose(0, 2, 1)
        size = np.diagonal(gram, axis1=1, axis2=2)
        kept = size > FREED**2 * before
        scale = np.where(kept, 1.0 / np.sqrt(np.where(kept, size, 1.0)), 0.0)
        values, vectors = np.linalg.eigh(gram * scale[:, :, None] * scale[:, None, :])
        good = values > RANK**2 * np.maximum(values[:, -1:], 1e-300)
        good &= values > 1e-9
        inverse = np.where(good, 1.0 / np.sqrt(np.where(good, values, 1.0)), 0.0)
        roots.append(np.asarray(scale[:, :, None] * vectors * inverse[:, None, :]))
        alongs.append(along)
        sizes.append(np.sqrt(np.where(kept, size, 0.0)))
        rank[m] = good.sum(axis=1)
    return Screen(problem, stack, grams, tangent, tuple(alongs), tuple(roots), tuple(sizes), rank)
