"""What changed between two measurements of a machine; what two specimens of a type share."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
from scipy.linalg import block_diag, cholesky, solve_triangular
from scipy.special import chdtrc

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import with_uncertainty, within
from stiffmap.common.short import short_repr
from stiffmap.common.units import DISPLAY_UNITS
from stiffmap.experiment.calls import Effects, as_experiment, effects_of
from stiffmap.experiment.experiment import Experiment
from stiffmap.experiment.noise.whitening import basis, readings_of
from stiffmap.identification.inference.amplitudes import fitted
from stiffmap.identification.inference.columns import Columns, across, drawn
from stiffmap.identification.inference.constants import RARE
from stiffmap.identification.inference.kernels import ReadingPoints, gaps
from stiffmap.identification.inference.parts import Part
from stiffmap.identification.planning.design import joined
from stiffmap.identification.planning.estimate import Estimate, estimate
from stiffmap.model.files.load import Source
from stiffmap.solve.machine import Machine, as_machine

MOST = 750
"""Readings of each experiment. Effort only: an (N, N) matrix is factorised."""
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
        size, unit = DISPLAY_UNITS.get(self.unit, (1.0, self.unit))
        before, after, u = (size * v for v in (self.before, self.after, self.u))
        return (
            f"{self.name}: {word}, {within(before, u)} -> {within(after, u)} {unit} "
            f"({with_uncertainty(after - before, 2 * u)}, p = {self.p:.2g})"
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

    @property
    def left_out(self) -> tuple[str, ...]:
        """Rows that the machine does not reach, in words."""
        return tuple(text for one in (self.first, self.second) for text in one.experiment.out_of_reach)

    @property
    def unexplained(self) -> tuple[str, ...]:
        """Experiments of which the followed numbers leave more than noise, in words."""
        each = ((one, float(chdtrc(max(one.freedom, 1), one.chi2))) for one in (self.first, self.second))
        what = "what is followed does not explain the readings"
        then = "so that the numbers may stand for another cause; run diagnose on it next"
        return tuple(
            f"{one.experiment.name}: {what}: {one.misfit:.2g} times their noise is left (lack of fit, p = {p:.2g}), {then}"
            for one, p in each
            if p < RARE
        )

    def as_plain(self) -> dict[str, Any]:
        """Data of JSON, SI."""
        more = {name: list(getattr(self, name)) for name in ("left_out", "unexplained")}
        return {"common": self.common, "p": self.p, "changes": [vars(c) for c in self.changes], **more}

    def __str__(self) -> str:
        word = "one set of numbers serves both" if self.common else "the two differ"
        left = [f"left out: {text}" for text in self.left_out]
        return "\n".join([f"{word} (p = {self.p:.2g})", *map(str, self.changes), *self.unexplained, *left])


def monitor(
    machine: Machine | Source,
    before: Experiment | str | PathLike[str],
    after: Experiment | str | PathLike[str],
    effects: Effects,
) -> Comparison:
    """What changed between two experiments, or whether two machines of a type share their numbers.

    before, after
        Experiments, their folders or files.
    effects
        What is followed: its numbers are fitted to each experiment on its own.

    Differences are judged against what the model leaves of both: smooth gaps that they share and errors of each pose, as large as
    the readings make likeliest, since neither is a change. Of more than some 1500 readings whole poses are drawn.
    Returns a `Comparison`: `changes` in SI with uncertainty and p-value each, `common` where one set of numbers serves both.
    Raises StiffmapError for bad input.
    """
    machine = as_machine(machine)
    terms = effects_of(machine, effects)
    if not terms:
        raise StiffmapError("effects: expected at least one effect to follow, got none")
    a, b = (estimate(machine, _some(as_experiment(e)), terms) for e in (before, after))
    step, covariance = difference(machine, a, b)
    u = np.sqrt(np.diag(covariance))
    single = chdtrc(1, (step / u) ** 2)
    known = np.flatnonzero(np.isfinite(u))
    scaled, pull = covariance[np.ix_(known, known)] / np.outer(u[known], u[known]), step[known] / u[known]
    together = float(pull @ np.linalg.pinv(scaled) @ pull)
    changes = tuple(
        Change(n, s, float(x), float(x + d), float(w), float(min(1.0, len(step) * p)))
        for n, s, x, d, w, p in zip(a.names, a.units, a.values, step, u, single, strict=True)
    )
    return Comparison(a, b, changes, float(chdtrc(max(len(known), 1), together)))


def difference(machine: Machine, a: Estimate, b: Estimate) -> tuple[Floats, Floats]:
    """(k,) second minus first value, SI, and (k, k) its covariance; infinite variances of numbers that either does not determine. Both
    are fitted at once, each with numbers of its own, under the covariance of all gaps that a diagnosis knows."""
    k = len(a.values)
    known = np.flatnonzero(np.isfinite(a.sigma) & np.isfinite(b.sigma))
    shift, covariance = b.values - a.values, np.diag(np.full(k, np.inf))
    if not known.size:
        return shift, covariance
    numbers = block_diag(a.jacobian[:, known], b.jacobian[:, known])
    residual = np.concatenate([a.residual, b.residual])
    root = cholesky(_left(machine, a, b, numbers, residual), lower=True)
    white = solve_triangular(root, np.column_stack([numbers, residual]), lower=True)
    columns, left = white[:, :-1], white[:, -1]
    spread = np.linalg.inv(columns.T @ columns)
    m = len(known)
    step = np.hstack([-np.eye(m), np.eye(m)])
    shift[known] += step @ (spread @ (columns.T @ left))
    covariance[np.ix_(known, known)] = step @ spread @ step.T
    return shift, covariance


def _left(machine: Machine, a: Estimate, b: Estimate, numbers: Floats, residual: Floats) -> Floats:
    """(N, N) covariance of noise and of all gaps that whitened readings (N,) of both can hold, numbers (N, 2 k) left open."""
    e = joined(a.experiment, b.experiment)
    read = [readings_of(x.experiment, x.problem.base) for x in (a, b)]
    rows = np.concatenate([read[0][0], read[1][0] + len(a.experiment)])
    channel = np.concatenate([read[0][1], read[1][1]])
    white = block_diag(*(x.problem.white_lines(np.eye(len(r[0]))) for x, r in zip((a, b), read, strict=True)))
    frames = block_diag(a.problem.nuisance, b.problem.nuisance)
    free = across(basis(np.hstack([frames, numbers])))
    kernels, parts = {}, []
    points = ReadingPoints(rows, channel, np.ones(len(rows)))
    # the hours of one session are not those of the other
    together = block_diag(*(np.ones((len(r[0]), len(r[0]))) for r in read))
    for kernel in gaps(machine, e, points):
        shown = kernel.between(points, points) * (together if kernel.kind == "time" else 1.0)
        shown = white @ shown @ white.T
        size = float(np.sum(free * (shown @ free))) / free.shape[1]
        if size > 0.0:
            kernels[kernel.name] = shown / size
            parts.append(Part(kernel.name, kernel.kind, full=free.T @ kernels[kernel.name] @ free))
    columns = Columns.bare(e, rows, channel, free, free.T @ residual)
    fit = fitted(columns, parts)
    noise = fit.noise**2 * np.eye(len(residual))
    return sum((fit.amplitude(name) ** 2 * kernel for name, kernel in kernels.items()), noise)


def _some(e: Experiment) -> Experiment:
    """The rows of poses drawn at random, where there are many readings."""
    per_row = max(1, int(e.axis_read.sum()))
    return e if len(e) * per_row <= MOST else e.rows(drawn(e.groups, 0, MOST // per_row))
