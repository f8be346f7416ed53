"""What changed between two measurements of a machine; what two specimens of a type share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from stiffmap.common.number_text import with_uncertainty, within
from stiffmap.common.short import short_repr
from stiffmap.experiment.experiment import Experiment
from stiffmap.identification.planning.estimate import Estimate, estimate
from stiffmap.identification.planning.left_over import difference
from stiffmap.model.description import AppliedEffect
from stiffmap.solve.machine import Machine

ALPHA = 0.01
"""Probability of naming a change in any number where there is none."""


@dataclass(frozen=True)
class Change:
    """One number in two experiments, SI."""

    name: str
    unit: str
    before: float
    after: float
    u: float
    """Standard uncertainty of the difference, what the model leaves included."""
    p: float
    """p-value of such a difference if nothing changed, corrected for the number of numbers (Bonferroni)."""

    @property
    def changed(self) -> bool:
        """Whether it is significant."""
        return self.p < ALPHA

    def __str__(self) -> str:
        if not np.isfinite(self.u):
            return f"{self.name}: not identifiable from these readings"
        word = "changed" if self.changed else "as before"
        step = self.after - self.before
        return (
            f"{self.name}: {word}, {within(self.before, self.u)} -> {within(self.after, self.u)} {self.unit} "
            f"({with_uncertainty(step, 2 * self.u)}, p = {self.p:.2g})"
        )


@short_repr
@dataclass(frozen=True, eq=False)
class Comparison:
    """Two experiments with the same effects fitted to each."""

    first: Estimate
    second: Estimate
    changes: tuple[Change, ...]
    p: float
    """p-value of all differences together if the numbers are common."""

    @property
    def common(self) -> bool:
        """Whether one set of numbers serves both: a property of the type rather than of a specimen."""
        return self.p >= ALPHA

    def __str__(self) -> str:
        word = "one set of numbers serves both" if self.common else "the two differ"
        return "\n".join([f"{word} (p = {self.p:.2g})", *map(str, self.changes)])


def compare(
    machine: Machine, first: Experiment, second: Experiment, terms: Sequence[AppliedEffect]
) -> Comparison:
    """Numbers of `terms` in two experiments: before and after, or one specimen and another.

    Each is fitted on its own; differences are judged against what the model leaves of both: a smooth field that they share
    and a variance per pose, as large as the readings make likeliest, since neither is a change.
    Raises StiffmapError as `estimate` does.
    """
    a, b = (estimate(machine, e, terms) for e in (first, second))
    step, covariance = difference(a, b)
    u = np.sqrt(np.diag(covariance))
    single = chi2.sf((step / u) ** 2, 1)
    told = np.flatnonzero(np.isfinite(u))
    scaled, pull = covariance[np.ix_(told, told)] / np.outer(u[told], u[told]), step[told] / u[told]
    together = float(pull @ np.linalg.pinv(scaled) @ pull)
    changes = tuple(
        Change(n, s, float(x), float(x + d), float(w), float(min(1.0, len(step) * p)))
        for n, s, x, d, w, p in zip(a.names, a.units, a.values, step, u, single, strict=True)
    )
    return Comparison(a, b, changes, float(chi2.sf(together, max(len(told), 1))))
