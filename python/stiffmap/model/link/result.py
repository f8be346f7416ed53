"""The identified link: compliance with everything the identification does not know about it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stiffmap.common.broadcasting import random_numbers
from stiffmap.common.errors import StiffmapError
from stiffmap.common.short import table, titled
from stiffmap.model.link.estimate import Evidence, SpringEstimate, critical_multiple
from stiffmap.model.link.noise import FieldNoise
from stiffmap.model.link.regression import constrain, structure
from stiffmap.model.link.report import unit_factor, unit_name, write_report
from stiffmap.model.link.rigidfit import design_matrix
from stiffmap.model.link.transport import Bools, Floats, Ints, standard_errors


@dataclass(frozen=True)
class Link(SpringEstimate):
    """An identified link: its numbers, and what can be made of them."""

    def with_zeros(self) -> Link:
        """The link re-estimated with the insignificant entries at zero (their error is then zero too)."""
        return replace(
            build_link(self.evidence, self.symmetric, self.level, self.insignificant),
            insignificant=self.insignificant,
        )

    def bootstrap(self, patches: int = 32, samples: int = 500, seed: int = 0) -> Floats:
        """(36, 36) covariance of the entries from resampled patches of nodes (block bootstrap).

        The same patches are drawn for every load case, so correlation between cases is kept. Patches must
        be larger than the correlation length and at least about twenty for the estimate to be good to 20 %.
        """
        e, f = self.evidence, self.evidence.field
        P = _projection(e, self.symmetric, self.insignificant if self.zeros_applied else None)
        gain = np.einsum("ef,kfa->kea", P, e.regression.gain)
        label = node_patches(f.points, min(patches, len(f.points) // 3))
        count, cases, kept = int(label.max()) + 1, len(f.displacements), e.kept.astype(float)
        A = design_matrix(f.points, f.reference)
        scale = np.array([1.0] * 3 + [1 / max(float(np.abs(A[:, :, 3:]).max()), 1e-300)] * 3)
        A = A * scale
        normal, right = np.zeros((count, cases, 6, 6)), np.zeros((count, cases, 6))
        np.add.at(normal, label, np.einsum("kn,nia,nib->nkab", kept, A, A))
        np.add.at(right, label, np.einsum("kn,nia,kni->nka", kept, A, f.displacements))
        drawn = random_numbers(seed).multinomial(count, np.full(count, 1 / count), size=samples)
        times = drawn.astype(float)
        M, b = np.einsum("sp,pkab->skab", times, normal), np.einsum("sp,pka->ska", times, right)
        solvable = np.linalg.cond(M).max(axis=1) < 1e8
        twists = np.linalg.solve(M[solvable], b[solvable][..., None])[..., 0] * scale
        return np.asarray(np.cov(np.einsum("kea,ska->se", gain, twists).T))

    def _repr_html_(self) -> str:
        c, s = self.compliance * unit_factor("mm"), self.standard_error * unit_factor("mm")
        shown = np.argwhere(np.triu(~self.insignificant | np.eye(6, dtype=bool)))
        rows = [
            (f"k{i + 1}{j + 1}", f"{c[i, j]:.4g}", f"{s[i, j]:.1g}", unit_name(i, j, "mm")) for i, j in shown
        ]
        return titled("compliance of the link", table(("entry", "value", "±", "unit"), rows))

    def report(self, length: str = "mm") -> str:
        """The table of the paper's Table 1 with error bars, then what speaks for and against the fit.

        Args:
            length: "mm" prints mm/N, 1/N, rad/(N·mm) as the paper does; "m" prints SI.
        """
        return write_report(self, length)


def build_link(evidence: Evidence, symmetric: bool, level: float, zeros: Bools | None = None) -> Link:
    """Project the regression on symmetry and zeros, carry the covariance along, and test for zeros.

    Raises:
        StiffmapError: a level outside (0, 1).
    """
    if not 0 < level < 1:
        raise StiffmapError(f"level: expected a probability between 0 and 1, got {level!r}")
    e, r = evidence, evidence.regression
    measured = np.tile(e.columns, (6, 1))
    known = measured | measured.T if symmetric else measured
    P = _projection(e, symmetric, zeros)
    raw = np.where(measured, r.entries.reshape(6, 6), np.nan)
    C = np.where(known, (P @ r.entries).reshape(6, 6), np.nan)
    V = P @ r.covariance @ P.T
    gain = np.einsum("ef,kfa->kea", P, r.gain)
    share = np.einsum("kea,kab,keb->ke", gain, e.twist_covariance, gain)
    dof = _satterthwaite(share, e.noise)
    least = critical_multiple(level, 21 if symmetric else 36, dof) * standard_errors(V)
    insignificant = (np.abs(C) <= least) & known
    V = np.where(np.outer(known.ravel(), known.ravel()), V, np.nan)
    return Link(
        C, V, e.noise.dof, e.noise.sigma, insignificant, level, ~e.kept, raw, r.covariance, dof, symmetric,
        zeros is not None, e,
    )  # fmt: skip


def _projection(e: Evidence, symmetric: bool, zeros: Bools | None) -> Floats:
    measured = np.tile(e.columns, (6, 1))
    Z = structure(symmetric=symmetric, zeros=zeros, known=measured)
    return constrain(e.regression.covariance, Z, measured.ravel())


def _satterthwaite(share: Floats, noise: FieldNoise) -> Floats:
    """(6, 6) degrees of freedom of a sum of per-case variances; pooled cases share one estimate."""
    if noise.pooled or not np.all(np.isfinite(noise.used_dof)):
        return np.full((6, 6), float(noise.used_dof[0]))
    total = share.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        dof = total**2 / np.sum(share**2 / noise.used_dof[:, None], axis=0)
    return np.asarray(np.where(np.isfinite(dof), dof, noise.used_dof.sum()).reshape(6, 6))


def node_patches(points: Floats, patches: int) -> Ints:
    """(n,) patch number of each node: halves along the longest side until there are ``patches``.

    The number is rounded down to a power of two. It does not depend on the numbering of the nodes.
    """
    order = np.lexsort(points.T)
    groups = [order]
    while 2 * len(groups) <= patches:
        sides = [int(np.argmax(np.ptp(points[g], axis=0))) for g in groups]
        ranked = [g[np.argsort(points[g, i], kind="stable")] for g, i in zip(groups, sides, strict=True)]
        groups = [half for g in ranked for half in (g[: len(g) // 2], g[len(g) // 2 :])]
    label = np.empty(len(points), dtype=np.int64)
    for number, group in enumerate(groups):
        label[group] = number
    return label
