"""The numbers of an identified link, and what follows from them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtrc, stdtrit

from stiffmap.model.link.checks import DisplacementField, finite_array
from stiffmap.model.link.noise import Correlation, FieldNoise
from stiffmap.model.link.regression import Regression
from stiffmap.model.link.rigidfit import RigidFit
from stiffmap.model.link.transport import (
    Bools,
    Floats,
    Ints,
    standard_errors,
    transport_compliance,
    unit_diagonal,
)


class Evidence(NamedTuple):
    """All that the estimate is made from; kept so that it can be made again under other constraints."""

    field: DisplacementField
    kept: Bools  # (cases, n)
    fits: tuple[RigidFit, ...]
    noise: FieldNoise
    correlation: Correlation | None
    twist_covariance: Floats  # (cases, 6, 6)
    regression: Regression
    columns: Bools  # (6,) columns of the compliance that the wrenches determine
    method: str


@dataclass(frozen=True)
class SpringEstimate:
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


def critical_multiple(level: float, tests: int, dof: Floats | float) -> Floats:
    """The paper's k of "k sigma": |entry| below k standard errors is not distinguishable from zero, link (8).

    Bonferroni over ``tests`` entries (21 under symmetry, else 36): the probability that any entry that is truly zero
    is taken for non-zero stays below ``level`` whatever the correlation of the entries.
    """
    return np.asarray(-stdtrit(dof, level / (2 * tests)))
