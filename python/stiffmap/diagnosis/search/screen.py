"""Screening: how much of the residual each candidate's sensitivities can take away.

All candidates at once: their whitened columns, freed of nuisances and of the effects that are already
in the model, are orthonormalised through their Gram matrices; the reduction of chi-square is then the squared projection.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln
from scipy.stats import chi2

from stiffmap.diagnosis.candidates.sensitivity import Variant
from stiffmap.diagnosis.fitting.model import VISIBLE
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.noise.whitening import Problem

RANK = 1e-5
FREED = 1e-3
"""Share of a column's length below which a model's directions leave nothing of it."""
AT_ONCE = 64
"""Variants that are whitened together."""


@dataclass(frozen=True, eq=False)
class Screen:
    """Whitened columns of all variants, and what makes them orthonormal beside a model."""

    variants: tuple[Variant, ...]
    members: tuple[NDArray[np.intp], ...]
    """Per number of parameters p: numbers of the variants."""
    white: tuple[Floats, ...]
    """Per p: (V_p p, N) whitened columns, one per line."""
    tangent: Floats
    """(N, k) orthonormal directions of the model."""
    along: tuple[Floats, ...]
    """Per p: (V_p, p, k) the columns along the model's directions; what counts is the rest of them."""
    roots: tuple[Floats, ...]
    """Per p: (V_p, p, p) M: the rest of the columns times M is orthonormal, zero where the rank is less than p."""
    rank: NDArray[np.intp]
    """(V,) number of directions that are seen; 0: nothing."""

    @staticmethod
    def of(problem: Problem, variants: Sequence[Variant]) -> Screen:
        """Screen of the variants beside an empty model."""
        sizes = np.array([v.columns.shape[-1] for v in variants], dtype=np.intp)
        members = tuple(np.flatnonzero(sizes == p) for p in np.unique(sizes))
        white = tuple(_white(problem, [variants[int(i)].columns for i in m]) for m in members)
        return _screen(tuple(variants), members, white, np.zeros((len(problem), 0)))

    def beside(self, tangent: Floats) -> Screen:
        """The screen with the directions `tangent` (N, k), orthonormal, of a model projected out."""
        return _screen(self.variants, self.members, self.white, tangent) if tangent.size else self

    def only(self, which: Sequence[int]) -> Screen:
        """The screen of some of the variants."""
        index = {int(v): k for k, v in enumerate(which)}
        chosen = [
            np.array([k for k, v in enumerate(m) if int(v) in index], dtype=np.intp) for m in self.members
        ]
        some = [k for k, c in enumerate(chosen) if len(c)]
        return Screen(
            tuple(self.variants[i] for i in which),
            tuple(np.array([index[int(v)] for v in self.members[k][chosen[k]]], dtype=np.intp) for k in some),
            tuple(
                self.white[k]
                .reshape(len(self.members[k]), -1, self.readings)[chosen[k]]
                .reshape(-1, self.readings)
                for k in some
            ),
            self.tangent,
            tuple(self.along[k][chosen[k]] for k in some),
            tuple(self.roots[k][chosen[k]] for k in some),
            self.rank[list(which)],
        )

    @property
    def readings(self) -> int:
        """N."""
        return int(self.tangent.shape[0])

    def basis(self, i: int) -> Floats:
        """(N, rank) orthonormal columns of variant i."""
        g, k = self._place(i)
        root = self.roots[g][k]
        return np.asarray(self.columns(i) @ root[:, np.any(root != 0.0, axis=0)])

    def columns(self, i: int) -> Floats:
        """(N, p) whitened columns of variant i, freed of the model's directions."""
        g, k = self._place(i)
        p = self.roots[g].shape[-1]
        rest = self.white[g][k * p : (k + 1) * p].T - self.tangent @ self.along[g][k].T
        return np.asarray(np.where(np.any(self.roots[g][k] != 0.0, axis=1), rest, 0.0))

    def _place(self, i: int) -> tuple[int, int]:
        for g, m in enumerate(self.members):
            k = int(np.searchsorted(m, i))
            if k < len(m) and m[k] == i:
                return g, k
        raise IndexError(i)

    def delta_chi2(self, residual: Floats) -> Floats:
        """(V, S) reduction of chi-square of each variant for residuals (N, S); nothing for one-parameter
        effects that would have to grow backwards."""
        out = np.zeros((len(self.variants), residual.shape[1]))
        rest = residual - self.tangent @ (self.tangent.T @ residual)
        for m, w, root in zip(self.members, self.white, self.roots, strict=True):
            v, p = root.shape[:2]
            along = (w @ rest).reshape(v, p, -1)
            reduction = ((root.transpose(0, 2, 1) @ along) ** 2).sum(axis=1)
            if p == 1:
                sign = np.array([self.variants[i].sign[0] for i in m])
                reduction = np.where(along[:, 0] * sign[:, None] >= 0, reduction, 0.0)
            out[m] = reduction
        return out

    def minus_log_p(self, delta_chi2: Floats) -> Floats:
        """(V,) -ln p of such reductions (V,) of chi-square without the effects."""
        return chi2_minus_log_p(delta_chi2, np.maximum(self.rank, 1))

    def largest_minus_log_p(self, residual: Floats) -> Floats:
        """(S,) -ln p of the best variant for residuals (N, S)."""
        delta_chi2 = self.delta_chi2(residual)
        best = [
            chi2_minus_log_p(delta_chi2[self.rank == r].max(axis=0), np.full(residual.shape[1], r))
            for r in np.unique(self.rank[self.rank > 0])
        ]
        return np.asarray(np.max(best, axis=0)) if best else np.zeros(residual.shape[1])

    def estimate(self, i: int, residual: Floats) -> Floats:
        """(p,) least-squares values of variant i in units of the parameters' scales."""
        return np.asarray(np.linalg.lstsq(self.columns(i), residual, rcond=RANK)[0])


def chi2_minus_log_p(delta_chi2: Floats, freedom: NDArray[np.intp]) -> Floats:
    """-ln p(chi-square >= delta_chi2); by its asymptote where p is below the smallest double."""
    with np.errstate(divide="ignore"):
        out = -chi2.logsf(delta_chi2, freedom)
    half = np.maximum(delta_chi2, 1.0) / 2
    far = half - (freedom / 2 - 1) * np.log(half) + gammaln(freedom / 2)
    return np.asarray(np.where(np.isfinite(out), out, far))


def _white(problem: Problem, columns: Sequence[Floats]) -> Floats:
    """(V p, N) whitened columns of (n, c, p) each, one per line; zero where the readings don't feel them."""
    out = [
        problem.white(np.concatenate(columns[k : k + AT_ONCE], axis=-1)).T
        for k in range(0, len(columns), AT_ONCE)
    ]
    white = np.concatenate(out)
    white[np.sqrt(np.einsum("ij,ij->i", white, white)) <= VISIBLE] = 0.0
    return white


def _screen(
    variants: tuple[Variant, ...],
    members: tuple[NDArray[np.intp], ...],
    white: tuple[Floats, ...],
    tangent: Floats,
) -> Screen:
    rank = np.zeros(len(variants), dtype=np.intp)
    alongs, roots = [], []
    for m, w in zip(members, white, strict=True):
        lines = w.reshape(len(m), -1, w.shape[-1])
        along = (w @ tangent).reshape(len(m), lines.shape[1], -1)
        gram = lines @ lines.transpose(0, 2, 1)
        before = np.diagonal(gram, axis1=1, axis2=2)
        gram = gram - along @ along.transpose(0, 2, 1)
        size = np.diagonal(gram, axis1=1, axis2=2)
        kept = size > FREED**2 * before
        scale = np.where(kept, 1.0 / np.sqrt(np.where(kept, size, 1.0)), 0.0)
        values, vectors = np.linalg.eigh(gram * scale[:, :, None] * scale[:, None, :])
        good = values > RANK**2 * np.maximum(values[:, -1:], 1e-300)
        good &= values > 1e-9
        inverse = np.where(good, 1.0 / np.sqrt(np.where(good, values, 1.0)), 0.0)
        roots.append(np.asarray(scale[:, :, None] * vectors * inverse[:, None, :]))
        alongs.append(along)
        rank[m] = good.sum(axis=1)
    return Screen(variants, members, white, tangent, tuple(alongs), tuple(roots), rank)
