"""The identified link: compliance with everything the identification does not know about it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2, t

from stiffmap.errors import StiffmapError
from stiffmap.link.arrays import Bools, Floats, Ints
from stiffmap.link.bootstrap import block_bootstrap
from stiffmap.link.checks import Field
from stiffmap.link.correlation import Correlation
from stiffmap.link.noise import Noise
from stiffmap.link.regression import Regression, constrain, structure
from stiffmap.link.report import write_report
from stiffmap.link.rigidfit import RigidFit
from stiffmap.link.transport import stiffness_covariance, transport_compliance
from stiffmap.link.zeros import critical_multiple, insignificant_entries


class Evidence(NamedTuple):
    """All that the estimate is made from; kept so that it can be made again under other constraints."""

    field: Field
    kept: Bools  # (cases, n)
    fits: tuple[RigidFit, ...]
    noise: Noise
    correlation: Correlation | None
    twist_covariance: Floats  # (cases, 6, 6)
    regression: Regression
    columns: Bools  # (6,) columns of the compliance that the wrenches determine
    method: str


@dataclass(frozen=True)
class Link:
    """Spring of a link at its reference point, link axes, SI. Entries are row-major where flattened."""

    compliance: Floats  # (6, 6) m/N, rad/(N·m), ...
    covariance: Floats  # (36, 36) of the entries; rank 21 under symmetry
    dof: Ints  # (cases,) 3 n - 6 of the nodes kept
    sigma: Floats  # (cases,) m, noise of the field per case
    insignificant: Bools  # (6, 6) zero within the test's level
    level: float  # family-wise level of that test
    outliers: Bools  # (cases, n)
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
        if np.isnan(self.compliance).any() or np.linalg.matrix_rank(_scaled(self.compliance)) < 6:
            return np.full((6, 6), np.nan)
        return np.asarray(np.linalg.inv(self.compliance))

    @property
    def standard_error(self) -> Floats:
        """(6, 6) standard errors of the compliance entries."""
        variance: Floats = np.maximum(np.diag(self.covariance), 0.0)
        return np.asarray(np.sqrt(variance).reshape(6, 6), dtype=np.float64)

    @property
    def stiffness_covariance(self) -> Floats:
        """(36, 36) covariance of the stiffness entries, first order."""
        return stiffness_covariance(self.compliance, self.covariance)

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
        size = np.sqrt(np.abs(np.diag(self.raw)))
        with np.errstate(invalid="ignore", divide="ignore"):
            return float(np.nanmax(np.abs(self.raw - self.raw.T) / np.outer(size, size)))

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
        return float(chi2.sf((gap / size) @ np.linalg.solve(V / np.outer(size, size), gap / size), 15))

    @property
    def case_p_value(self) -> float:
        """Chi-square p-value of "the cases agree with one matrix"; NaN when none is repeated."""
        r = self.evidence.regression
        return float(chi2.sf(r.lack_of_fit, r.lack_dof)) if r.lack_dof else float("nan")

    def interval(self, probability: float = 0.95) -> Floats:
        """(6, 6, 2) confidence interval of each entry (not simultaneous)."""
        half = t.isf((1 - probability) / 2, self.entry_dof) * self.standard_error
        return np.stack([self.compliance - half, self.compliance + half], axis=-1)

    def at(self, reference: Floats) -> tuple[Floats, Floats]:
        """Compliance (6, 6) and covariance (36, 36) at another reference point (3,) m, same axes."""
        shift = np.asarray(reference, dtype=float) - self.reference
        return transport_compliance(self.compliance, self.covariance, shift)

    def with_zeros(self) -> Link:
        """The link re-estimated with the insignificant entries at zero (their error is then zero too)."""
        return replace(
            build_link(self.evidence, self.symmetric, self.level, self.insignificant),
            insignificant=self.insignificant,
        )

    def bootstrap(self, patches: int = 32, samples: int = 500, seed: int = 0) -> Floats:
        """(36, 36) covariance of the entries from resampled patches of nodes (block bootstrap)."""
        e = self.evidence
        P = _projection(e, self.symmetric, self.insignificant if self.zeros_applied else None)
        gain = np.einsum("ef,kfa->kea", P, e.regression.gain)
        f = e.field
        return block_bootstrap(f.points, f.displacements, gain, f.reference, e.kept, patches, samples, seed)

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
    error = np.sqrt(np.maximum(np.diag(V), 0)).reshape(6, 6)
    insignificant = insignificant_entries(C, error, dof, level, 21 if symmetric else 36) & known
    V = np.where(np.outer(known.ravel(), known.ravel()), V, np.nan)
    return Link(
        C, V, e.noise.dof, e.noise.sigma, insignificant, level, ~e.kept, raw, r.covariance, dof, symmetric,
        zeros is not None, e,
    )  # fmt: skip


def _projection(e: Evidence, symmetric: bool, zeros: Bools | None) -> Floats:
    measured = np.tile(e.columns, (6, 1))
    Z = structure(symmetric=symmetric, zeros=zeros, known=measured)
    return constrain(e.regression.covariance, Z, measured.ravel())


def _satterthwaite(share: Floats, noise: Noise) -> Floats:
    """(6, 6) degrees of freedom of a sum of per-case variances; pooled cases share one estimate."""
    if noise.pooled or not np.all(np.isfinite(noise.used_dof)):
        return np.full((6, 6), float(noise.used_dof[0]))
    total = share.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        dof = total**2 / np.sum(share**2 / noise.used_dof[:, None], axis=0)
    return np.asarray(np.where(np.isfinite(dof), dof, noise.used_dof.sum()).reshape(6, 6))


def _scaled(C: Floats) -> Floats:
    size = np.sqrt(np.abs(np.diag(C)))
    size = np.where(size > 0, size, 1.0)
    return np.asarray(C / np.outer(size, size))
