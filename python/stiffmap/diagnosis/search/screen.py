"""Screening: how much of the residual each candidate's sensitivities can take away.

All candidates at once: their whitened columns, freed of nuisances and of the effects that are already
in the model, are orthonormalised; the reduction of chi-square is then the squared projection.
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


@dataclass(frozen=True, eq=False)
class Screen:
    """Orthonormal bases of all variants."""

    variants: tuple[Variant, ...]
    white: tuple[Floats, ...]
    """Per number of parameters p: (V_p, N, p) whitened columns, freed of the model's tangent."""
    bases: tuple[Floats, ...]
    """Per p: (V_p, N, p) orthonormal columns, zero where the rank is less than p."""
    members: tuple[NDArray[np.intp], ...]
    """Per p: numbers of the variants."""
    rank: NDArray[np.intp]
    """(V,) number of directions that are seen; 0: nothing."""

    @staticmethod
    def of(problem: Problem, variants: Sequence[Variant]) -> Screen:
        """Screen of the variants beside an empty model."""
        sizes = np.array([v.columns.shape[-1] for v in variants], dtype=np.intp)
        members = tuple(np.flatnonzero(sizes == p) for p in np.unique(sizes))
        white = tuple(np.stack([_white(problem, variants[int(i)].columns) for i in m]) for m in members)
        seen = tuple(np.where(np.linalg.norm(w, axis=1, keepdims=True) > VISIBLE, w, 0.0) for w in white)
        return _screen(tuple(variants), seen, members)

    def beside(self, tangent: Floats) -> Screen:
        """The screen with the directions `tangent` (N, k), orthonormal, of a model projected out."""
        if not tangent.size:
            return self
        white = tuple(w - tangent @ (tangent.T @ w) for w in self.white)
        before = [np.linalg.norm(w, axis=1, keepdims=True) for w in self.white]
        kept = tuple(
            np.where(np.linalg.norm(w, axis=1, keepdims=True) > 1e-3 * b, w, 0.0)
            for w, b in zip(white, before, strict=True)
        )
        return _screen(self.variants, kept, self.members)

    def only(self, which: Sequence[int]) -> Screen:
        """The screen of some of the variants."""
        index = {int(v): k for k, v in enumerate(which)}
        chosen = [
            np.array([k for k, v in enumerate(m) if int(v) in index], dtype=np.intp) for m in self.members
        ]
        some = [k for k, c in enumerate(chosen) if len(c)]
        return Screen(
            tuple(self.variants[i] for i in which),
            tuple(self.white[k][chosen[k]] for k in some),
            tuple(self.bases[k][chosen[k]] for k in some),
            tuple(np.array([index[int(v)] for v in self.members[k][chosen[k]]], dtype=np.intp) for k in some),
            self.rank[list(which)],
        )

    @property
    def readings(self) -> int:
        """N."""
        return int(self.white[0].shape[1]) if self.white else 0

    def basis(self, i: int) -> Floats:
        """(N, rank) orthonormal columns of variant i."""
        for m, b in zip(self.members, self.bases, strict=True):
            if i in m:
                q = b[int(np.searchsorted(m, i))]
                return np.asarray(q[:, np.any(q != 0.0, axis=0)])
        raise IndexError(i)

    def columns(self, i: int) -> Floats:
        """(N, p) whitened columns of variant i."""
        for m, w in zip(self.members, self.white, strict=True):
            if i in m:
                return np.asarray(w[int(np.searchsorted(m, i))])
        raise IndexError(i)

    def delta_chi2(self, residual: Floats) -> Floats:
        """(V, S) reduction of chi-square of each variant for residuals (N, S); nothing for one-parameter
        effects that would have to grow backwards."""
        out = np.zeros((len(self.variants), residual.shape[1]))
        for m, w, b in zip(self.members, self.white, self.bases, strict=True):
            v, n, p = b.shape
            projected = (b.transpose(0, 2, 1).reshape(v * p, n) @ residual).reshape(v, p, -1)
            reduction = (projected**2).sum(axis=1)
            if p == 1:
                direction = np.sign(np.einsum("vn,vn->v", w[:, :, 0], b[:, :, 0]))
                sign = direction * np.array([self.variants[i].sign[0] for i in m])
                reduction = np.where(projected[:, 0] * sign[:, None] >= 0, reduction, 0.0)
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


def _white(problem: Problem, columns: Floats) -> Floats:
    return problem.white(columns)


def _screen(
    variants: tuple[Variant, ...], white: tuple[Floats, ...], members: tuple[NDArray[np.intp], ...]
) -> Screen:
    rank = np.zeros(len(variants), dtype=np.intp)
    bases = []
    for m, w in zip(members, white, strict=True):
        norm = np.linalg.norm(w, axis=1, keepdims=True)
        unit = w / np.where(norm > 0, norm, 1.0)
        values, vectors = np.linalg.eigh(unit.transpose(0, 2, 1) @ unit)
        good = values > RANK**2 * np.maximum(values[:, -1:], 1e-300)
        good &= values > 1e-9
        inverse = np.where(good, 1.0 / np.sqrt(np.where(good, values, 1.0)), 0.0)
        bases.append(np.asarray(unit @ (vectors * inverse[:, None, :])))
        rank[m] = good.sum(axis=1)
    return Screen(variants, white, tuple(bases), members, rank)
