"""The identified link: compliance with everything the identification does not know about it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.common.html import table, titled
from stiffmap.model.link.arrays import Bools, Floats
from stiffmap.model.link.bootstrap import block_bootstrap
from stiffmap.model.link.estimate import Estimate, Evidence
from stiffmap.model.link.noise import Noise
from stiffmap.model.link.regression import constrain, structure
from stiffmap.model.link.report import unit_factor, unit_name, write_report
from stiffmap.model.link.zeros import insignificant_entries


@dataclass(frozen=True)
class Link(Estimate):
    """An identified link: its numbers, and what can be made of them."""

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

    def _repr_html_(self) -> str:
        c, s, f = self.compliance, self.standard_error, unit_factor("mm")
        rows = [
            (
                f"k{i + 1}{j + 1}",
                f"{c[i, j] * f[i, j]:.4g}",
                f"{s[i, j] * f[i, j]:.1g}",
                unit_name(i, j, "mm"),
            )
            for i in range(6)
            for j in range(i, 6)
            if i == j or not self.insignificant[i, j]
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
