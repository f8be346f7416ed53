"""Readings, unknowns and what the readings feel of them: the fit that a calibration's inference starts from."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stiffmap.experiment.experiment import Floats, Integers, Mask
from stiffmap.experiment.noise.level import Noise, noise_of
from stiffmap.experiment.noise.outliers import outliers
from stiffmap.experiment.noise.whitening import Problem, nuisance_part
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.calibration.floor import Blocks, model_form
from stiffmap.identification.calibration.groups import STRONG
from stiffmap.identification.calibration.homing import zeros_anew
from stiffmap.identification.calibration.model import (
    FIRST,
    STEPS,
    Fitted,
    Progress,
    Sensitivity,
    bends,
    fitted,
    sensitivity,
    sensitivity_at,
)
from stiffmap.identification.calibration.statistics import Sums, directions
from stiffmap.identification.calibration.unknowns import GROUPS, Unknown

TYPICAL = 1.2
"""Robust spread of residuals, in noise floors, that still counts as a model that fits."""
DEMANDED = 5.41
"""Nats by which readings must demand a floor: half the chi-square of one degree of freedom of one in a thousand."""


@dataclass(frozen=True, eq=False)
class Calibrator:
    """Readings, unknowns and what the readings feel of them, ready for inference."""

    predictor: Predictor
    sensitivity: Sensitivity
    noise: Noise
    problem: Problem
    columns: Floats
    """(N, p) whitened."""
    fit: Fitted
    rho: float
    """Variance of the model's error per pose, in noise variances."""
    out: Mask
    seconds: dict[str, float]
    until: float = np.inf

    @property
    def stopped(self) -> bool:
        """Whether the time budget ended it before it was done."""
        late = not self.fit.converged and time.monotonic() > self.until
        return self.sensitivity.stopped or late

    @staticmethod
    def of(
        predictor: Predictor,
        wanted: Sequence[Unknown],
        until: float = np.inf,
        progress: Progress | None = None,
    ) -> Calibrator:
        """Sensitivities, one fit, outliers taken out, the fit again without them."""
        start = time.perf_counter()
        e = predictor.experiment
        s = sensitivity(predictor, wanted, until=until, progress=progress)
        noise = noise_of(e)
        nobody = np.zeros(len(e), bool)
        begun = time.perf_counter()
        seconds = {"sensitivities": begun - start}
        first = Calibrator._on(predictor, s, noise, nobody, until, seconds)
        out = first._alone()
        found = first
        if out.any():
            found = Calibrator._on(predictor, s, noise, out, until, seconds, start=first.fit.values)
        more = zeros_anew(s, e)
        if more is not None and found.better_with(more):
            begin = np.append(found.fit.values, np.zeros(len(more.unknowns) - len(s.unknowns)))
            s = more
            found = Calibrator._on(predictor, s, noise, out, until, seconds, start=begin)
        fit = found.fit
        bent = not fit.converged or bends(found.problem.white, s, fit.values, fit.prediction)
        if time.monotonic() < until and bent:
            s = sensitivity_at(predictor, s, fit.values, until)
            found = Calibrator._on(predictor, s, noise, out, until, seconds, fit)
        seconds["fit"] = time.perf_counter() - begun
        return found

    @staticmethod
    def _on(
        predictor: Predictor,
        s: Sensitivity,
        noise: Noise,
        out: Mask,
        until: float,
        seconds: dict[str, float],
        at: Fitted | None = None,
        start: Floats | None = None,
    ) -> Calibrator:
        """`start`: values to begin with. `at`: where the columns of `s` were taken anew. What frames and tools do is then taken there as well: a
        tool's shift turned otherwise than its frame would else leave a thousandth that no frame explains."""
        e = predictor.experiment
        problem = Problem.of(e, noise.sigma, s.base if at is None else at.prediction, ~out)
        columns = problem.white(s.columns)
        label = pose_labels(problem)
        q = problem.nuisance.shape[1]
        felt = columns @ directions(columns)

        def weigh(a: Floats, linear: Floats) -> tuple[Floats, float]:
            rho = model_form(Blocks.of(felt, linear, label, q))
            return Blocks.of(a, linear, label, q).beside(rho).estimate, 1.0 + rho

        start, steps = (start, FIRST) if at is None else (at.values, STEPS)
        fit = fitted(predictor, problem, s, columns, weigh, start=start, until=until, steps=steps)
        rho = model_form(Blocks.of(felt, fit.linear, label, q))
        return Calibrator(predictor, s, noise, problem, columns, fit, rho, out, seconds, until)

    def better_with(self, more: Sensitivity) -> bool:
        """Whether the evidence asks for unknowns beyond those that there are, each at a floor of its own."""
        label, q = pose_labels(self.problem), self.problem.nuisance.shape[1]
        wide = self.problem.white(more.columns)
        own, other = (Blocks.of(c @ directions(c), self.fit.linear, label, q) for c in (self.columns, wide))
        gain = other.log_likelihood(model_form(other)) - own.log_likelihood(model_form(own))
        return gain > STRONG

    def _alone(self) -> Mask:
        """(n,) outliers of the fit's residuals, judged against their typical size, so that a model that misfits as a
        whole makes none."""
        e = self.predictor.experiment
        left = self.left(self.fit.prediction)
        seen = np.isfinite(left).any(axis=0)
        typical = np.ones(left.shape[1])
        typical[seen] = 1.4826 * np.nanmedian(np.abs(left / self.noise.sigma)[:, seen], axis=0)
        by_noise = outliers(e, left, self.noise.sigma * np.maximum(typical / TYPICAL, 1.0))
        return by_noise | outliers(e, left, self.noise.sigma * np.maximum(typical, 1.0), lone=True)

    def left(self, prediction: Floats) -> Floats:
        """(n, c) reading minus prediction, less the frames and zeros that fit best."""
        raw = self.predictor.experiment.reading - prediction
        return np.asarray(raw - nuisance_part(self.problem, raw))

    def blocks(self, rows: Mask | None = None, fit: Fitted | None = None) -> Blocks:
        """Readings (of some, (N,)) in blocks of one pose and channel; `fit`: another than the calibration's own."""
        label, q = pose_labels(self.problem), int(self.problem.nuisance.shape[1])
        linear = (fit or self.fit).linear
        if rows is None:
            return Blocks.of(self.columns, linear, label, q)
        return Blocks.of(self.columns[rows], linear[rows], label[rows])

    @property
    def sums(self) -> Sums:
        """All readings, at the model-form floor."""
        return self.blocks().beside(self.rho)

    def members(self) -> dict[str, list[int]]:
        """Numbers of the unknowns of each group."""
        out: dict[str, list[int]] = {g: [] for g in GROUPS}
        for i, p in enumerate(self.sensitivity.unknowns):
            out[p.group].append(i)
        return {g: i for g, i in out.items() if i}

    def unwhite(self, residual: Floats) -> Floats:
        """(n, c) SI of whitened residuals (N,)."""
        out = np.full(self.problem.sigma.shape, np.nan)
        out[self.problem.index] = residual * self.problem.sigma[self.problem.index]
        return out

    def misfits(self, fit: Fitted, factor: Floats) -> bool:
        """Whether the readings demand a floor beyond noise."""
        blocks = self.blocks(fit=fit).scaled(factor)
        return blocks.log_likelihood(model_form(blocks)) - blocks.log_likelihood(0.0) > DEMANDED


def pose_labels(problem: Problem) -> Integers:
    """(N,) number of the cluster (of one pose), set-up and channel of each reading."""
    e = problem.experiment
    row, axis = problem.index
    return np.asarray((e.clusters[row] * (int(e.runs.max()) + 1) + e.runs[row]) * len(e.channels) + axis)
