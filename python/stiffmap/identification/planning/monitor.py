"""What changed between two measurements of a machine; what two specimens of a type share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from stiffmap.common.broadcasting import Floats
from stiffmap.common.number_text import with_uncertainty, within
from stiffmap.common.short import short_repr
from stiffmap.experiment.experiment import PER_ROW, Experiment
from stiffmap.identification.calibration.claims import LENGTHS, SIZES, field_columns
from stiffmap.identification.calibration.floor import Blocks, likeliest
from stiffmap.identification.planning.estimate import Estimate, estimate
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


# The difference of fitted numbers between two experiments, judged against the residual of their model.
#
# What a model of the machine leaves is no noise: it is smooth over the workspace, shared by the readings of a pose, and the
# same in both experiments where they stand at the same poses. Both are fitted at once, each with numbers of its own, jointly with
# one smooth field and one variance per pose, as large as the readings make likeliest (docs/theory.md I2, I3).

WIDE = 1e3
"""Of a number's standard uncertainty by noise alone: a prior that says nothing."""
NATS = 1.0
"""By which a floor must be likelier than none."""


def difference(a: Estimate, b: Estimate) -> tuple[Floats, Floats]:
    """(k,) second minus first value, SI, and (k, k) its covariance; infinite variances of numbers that either does not
    tell."""
    k = len(a.values)
    told = np.flatnonzero(np.isfinite(a.sigma) & np.isfinite(b.sigma))
    shift, covariance = b.values - a.values, np.diag(np.full(k, np.inf))
    if not told.size:
        return shift, covariance
    scale = np.concatenate([WIDE * e.misfit * e.sigma[told] for e in (a, b)])
    first, second = (e.jacobian[:, told] for e in (a, b))
    numbers = np.block(
        [
            [first, np.zeros((len(first), len(told)))],
            [np.zeros((len(second), len(told))), second],
        ]
    )
    residual = np.concatenate([a.residual, b.residual])
    e = _together(a.experiment, b.experiment)
    label = _labels(e, a, b)
    best, where = -np.inf, Blocks.of(numbers * scale, residual, label)
    rho = 0.0
    for size, columns in _fields(e, a, b):
        blocks = Blocks.of(np.hstack([numbers * scale, size * columns]), residual, label)
        for share, nats in ((0.0, blocks.log_likelihood(0.0) + NATS), likeliest(blocks, 1e-3)):
            if nats > best:
                best, where, rho = nats, blocks, share
    sums = where.beside(rho)
    m = 2 * len(told)
    values, spread = sums.estimate[:m] * scale, sums.covariance[:m, :m] * np.outer(scale, scale)
    spread = spread * max(1.0, sums.chi2 / max(a.freedom + b.freedom, 1))
    step = np.hstack([-np.eye(len(told)), np.eye(len(told))])
    shift[told] += step @ values
    covariance[np.ix_(told, told)] = step @ spread @ step.T
    return shift, covariance


def _fields(e: Experiment, a: Estimate, b: Estimate) -> list[tuple[float, Floats]]:
    """Sizes and whitened columns (N, m) of the fields that are tried; none at first."""
    n = len(a.experiment)
    out = [(0.0, np.zeros((len(a.residual) + len(b.residual), 0)))]
    for length in LENGTHS:
        field = field_columns(e, np.concatenate([a.left, b.left]), length)
        white = np.vstack([a.problem.white(field[:n]), b.problem.white(field[n:])])
        out += [(size, white) for size in SIZES]
    return out


def _labels(e: Experiment, a: Estimate, b: Estimate) -> np.ndarray[tuple[int, ...], np.dtype[np.intp]]:
    """(N,) number of the pose and channel of each reading of both."""
    row = np.concatenate([a.problem.index[0], b.problem.index[0] + len(a.experiment)])
    channel = np.concatenate([a.problem.index[1], b.problem.index[1]])
    return np.asarray(e.groups[row] * len(e.channels) + channel, dtype=np.intp)


def _together(a: Experiment, b: Experiment) -> Experiment:
    """The rows of both; what one of them does not record is recorded by neither."""

    def joined(name: str) -> object:
        one, other = getattr(a, name), getattr(b, name)
        if one is None or other is None:
            return None
        if isinstance(one, tuple):
            return (*one, *other) if len(one) and len(other) else ()
        return np.concatenate([one, other])

    return replace(a, **{name: joined(name) for name in PER_ROW}, absolute={})  # type: ignore[arg-type]
