"""The identified link: compliance with everything the identification does not know about it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtrc, stdtrit

from stiffmap.common.broadcasting import Floats, Mask, random_numbers
from stiffmap.common.errors import StiffmapError
from stiffmap.common.short import table, titled
from stiffmap.model.link.checks import DisplacementField, finite_array
from stiffmap.model.link.noise import Correlation, FieldNoise
from stiffmap.model.link.regression import Regression, constrain, structure
from stiffmap.model.link.report import UNIT_FACTOR, findings, unit_name
from stiffmap.model.link.rigidfit import RigidFit, design_matrix
from stiffmap.model.link.transport import Ints, standard_errors, transport_compliance, unit_diagonal


class Evidence(NamedTuple):
    """All that the estimate is made from; kept so that it can be made again under other constraints."""

    field: DisplacementField
    kept: Mask  # (cases, n)
    fits: tuple[RigidFit, ...]
    noise: FieldNoise
    correlation: Correlation | None
    twist_covariance: Floats  # (cases, 6, 6)
    regression: Regression
    columns: Mask  # (6,) columns of the compliance that the wrenches determine
    method: str


@dataclass(frozen=True)
class Link:
    """An identified link: its spring at its reference point, link axes, SI. Entries are row-major where flattened."""

    compliance: Floats  # (6, 6) m/N, rad/(N·m), ...
    covariance: Floats  # (36, 36) of the entries; rank 21 under symmetry
    dof: Ints  # (cases,) 3 n - 6 of the nodes kept
    sigma: Floats  # (cases,) m, noise of the field per case
    insignificant: Mask  # (6, 6) zero within the test's level
    level: float  # family-wise level of that test
    outliers: Mask  # (cases, n)
    raw: Floats  # (6, 6) before symmetry and zeros
    raw_covariance: Floats  # (36, 36)
    entry_dof: Floats  # (6, 6) degrees of freedom behind each standard error (Satterthwaite)
    symmetric: bool
    zeros_applied: bool
    evidence: Evidence

    @property
    def reference(self) -> Floats:
        """(3,) m, the point where the spring sits, link axes."""
        return self.evidence.field.reference

    @property
    def stiffness(self) -> Floats:
        """(6, 6) inverse of the compliance; NaN where the compliance is not fully identified."""
        if np.isnan(self.compliance).any() or np.linalg.matrix_rank(unit_diagonal(self.compliance)) < 6:
            return np.full((6, 6), np.nan)
        return np.asarray(np.linalg.inv(self.compliance))

    @property
    def standard_error(self) -> Floats:
        """(6, 6) standard errors of the compliance entries."""
        return standard_errors(self.covariance)

    @property
    def stiffness_covariance(self) -> Floats:
        """(36, 36) covariance of the stiffness entries, first order: ``dK = -K dC K``, link (12)."""
        K = self.stiffness
        gain = np.kron(K, K.T)
        return np.asarray(gain @ self.covariance @ gain.T)

    @property
    def tests(self) -> int:
        """Distinct entries in the zero test: 21 under symmetry, else 36."""
        return 21 if self.symmetric else 36

    @property
    def multiple(self) -> Floats:
        """(6, 6) the k of the paper's "k sigma" that the level and the degrees of freedom give."""
        return critical_multiple(self.level, self.tests, self.entry_dof)

    @property
    def residual(self) -> Floats:
        """(cases, n, 3) m, displacement less the fitted rigid motion; NaN at outliers."""
        out = np.full(self.evidence.field.displacements.shape, np.nan)
        for k, fit in enumerate(self.evidence.fits):
            out[k, self.evidence.kept[k]] = fit.residual
        return out

    @property
    def asymmetry(self) -> float:
        """Largest |raw - raw^T| over sqrt(C_ii C_jj), before symmetrisation."""
        scaled = unit_diagonal(self.raw)
        return float(np.nanmax(np.abs(scaled - scaled.T)))

    @property
    def symmetry_p_value(self) -> float:
        """Chi-square p-value of "the raw matrix is symmetric" under its covariance; NaN when partial."""
        if np.isnan(self.raw).any():
            return float("nan")
        D = np.array([np.eye(36)[6 * i + j] - np.eye(36)[6 * j + i] for i in range(6) for j in range(i)])
        gap, V = D @ self.raw.ravel(), D @ self.raw_covariance @ D.T
        size = np.sqrt(np.diag(V))
        if not np.all(size > 0):
            return float("nan")
        return float(chdtrc(15, (gap / size) @ np.linalg.solve(V / np.outer(size, size), gap / size)))

    @property
    def case_p_value(self) -> float:
        """Chi-square p-value of "the cases agree with one matrix"; NaN when none is repeated."""
        r = self.evidence.regression
        return float(chdtrc(r.lack_dof, r.lack_of_fit)) if r.lack_dof else float("nan")

    def interval(self, probability: float = 0.95) -> Floats:
        """(6, 6, 2) confidence interval of each entry (not simultaneous)."""
        half = -stdtrit(self.entry_dof, (1 - probability) / 2) * self.standard_error
        return np.stack([self.compliance - half, self.compliance + half], axis=-1)

    def at(self, reference: ArrayLike) -> tuple[Floats, Floats]:
        """Compliance (6, 6) and covariance (36, 36) at another reference point (3,) m, same axes."""
        point = finite_array("reference", reference, (3,), "(3,) in m")
        return transport_compliance(self.compliance, self.covariance, point - self.reference)

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
        c, s = self.compliance * UNIT_FACTOR, self.standard_error * UNIT_FACTOR
        shown = np.argwhere(np.triu(~self.insignificant | np.eye(6, dtype=bool)))
        rows = [(f"k{i + 1}{j + 1}", f"{c[i, j]:.4g}", f"{s[i, j]:.1g}", unit_name(i, j)) for i, j in shown]
        return titled("compliance of the link", table(("entry", "value", "±", "unit"), rows))

    def report(self) -> str:
        """The table of the paper's Table 1 (mm/N, 1/N, rad/(N·mm)) with error bars, then what speaks for and against the fit."""
        return "\n".join([*_table(self), *_field_lines(self), *_matrix_lines(self)])


def critical_multiple(level: float, tests: int, dof: Floats | float) -> Floats:
    """The paper's k of "k sigma": |entry| below k standard errors is not distinguishable from zero, link (8).

    Bonferroni over ``tests`` entries (21 under symmetry, else 36): the probability that any entry that is truly zero
    is taken for non-zero stays below ``level`` whatever the correlation of the entries.
    """
    return np.asarray(-stdtrit(dof, level / (2 * tests)))


def build_link(evidence: Evidence, symmetric: bool, level: float, zeros: Mask | None = None) -> Link:
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


def _projection(e: Evidence, symmetric: bool, zeros: Mask | None) -> Floats:
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


def _table(link: Link) -> list[str]:
    C, error = link.compliance * UNIT_FACTOR, link.standard_error * UNIT_FACTOR
    zero = link.insignificant
    diagonal = [(i, i) for i in range(6)]
    pairs = diagonal + [
        (i, j) for i in range(6) for j in range(6) if i != j and (i < j or not link.symmetric)
    ]
    lines = [f"{'entry':<6} {'value':>13} {'std. error':>11} {'rel.':>8}  unit"]
    for i, j in pairs:
        if zero[i, j] and i != j:
            continue
        with np.errstate(invalid="ignore", divide="ignore"):
            relative = abs(error[i, j] / C[i, j])
        mark = "  zero within the test" if zero[i, j] else ""
        numbers = f"{C[i, j]:>13.5e} {error[i, j]:>11.1e} {relative:>8.1e}"
        lines.append(f"k{i + 1}{j + 1:<4} {numbers}  {unit_name(i, j)}{mark}")
    names = [f"k{i + 1}{j + 1}" for i, j in pairs if zero[i, j] and i != j]
    k = float(np.nanmin(link.multiple))
    lines.append(
        f"zero within {k:.2f} standard errors (family-wise level {link.level:g} over {link.tests} entries): "
        + (", ".join(names) or "none")
        + ("; set to zero and re-estimated" if link.zeros_applied else "")
    )
    return lines


def _field_lines(link: Link) -> list[str]:
    e, noise = link.evidence, link.evidence.noise
    size = np.sqrt(np.mean(np.sum(e.field.displacements**2, axis=2), axis=1))
    place = np.array2string(link.reference, precision=6)
    lines = [f"rigid-body residual, {e.kept.shape[1]} nodes, reference {place} m:"]
    share = np.divide(link.sigma, size, out=np.full_like(size, np.nan), where=size > 0)
    for k in range(len(size)):
        gone = int(link.outliers[k].sum())
        loose = "; NOT rigid: are these nodes of the loaded end alone?" if share[k] > 0.1 else ""
        lines.append(
            f"  case {k + 1}: sigma {link.sigma[k]:.2e} m ({share[k]:.1e} of the displacement), "
            f"{link.dof[k]} degrees of freedom, {gone} outliers{loose}"
        )
    kind = "pooled" if noise.pooled else "given" if not np.all(np.isfinite(noise.used_dof)) else "per case"
    lines.append(f"noise: {kind} (homogeneity p = {noise.homogeneity:.2g})")
    c = e.correlation
    if c is None:
        lines.append("independence of the noise: taken as given")
    elif not c.correlated:
        lines.append(f"independence of the noise: not rejected (p = {c.p_value:.2g})")
    else:
        lines.append(
            f"independence of the noise: REJECTED (p = {c.p_value:.1g}); correlation length "
            f"{1e3 * c.length:.3g} mm, {c.effective_nodes:.3g} effective nodes of {e.kept.shape[1]}, "
            f"errors enlarged by {np.sqrt(c.inflation.mean()):.3g}; "
            f"largest correlation between cases {c.repetition:.2f}"
        )
    return lines


def _matrix_lines(link: Link) -> list[str]:
    missing = ~np.isfinite(link.compliance)
    # 0.1 is more than warping of the face and the mesh make
    wrong = link.asymmetry > 0.1 and link.symmetry_p_value < link.level
    lines = [
        f"asymmetry before symmetrisation: {link.asymmetry:.2e} of sqrt(kii kjj) "
        f"(p = {link.symmetry_p_value:.2g})"
        + ("; NOT an elastic body: compare order, units and reference of the wrenches" if wrong else ""),
        *findings(link.compliance, link.covariance),
    ]
    if np.isfinite(link.case_p_value):
        lines.append(f"agreement of the cases with one matrix: p = {link.case_p_value:.2g}")
    if missing.any():
        names = ", ".join(f"k{i + 1}{j + 1}" for i, j in np.argwhere(missing))
        lines.append(f"not identified: {names}")
    return lines
