"""Which mistake of writing or mounting explains readings better than any part of the machine does.

A mistake is named only where it takes away all but `LEFT` of the squared misfit and no single part of the machine
comes near that; what a part of the machine may show as well (a factor of two) only where none does.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.noise.checks import checks
from stiffmap.experiment.noise.level import Noise, noise_of
from stiffmap.experiment.noise.outliers import without_suspects
from stiffmap.experiment.noise.whitening import Problem
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.candidates.plan import Plan
from stiffmap.identification.diagnosis.slips.axes import coordinates, gauges, loads, moved, shifts, steps
from stiffmap.identification.diagnosis.slips.factors import factors
from stiffmap.identification.diagnosis.slips.screen import Screen
from stiffmap.identification.diagnosis.slips.slip import Hypothesis, Slip
from stiffmap.model.effects import get

MOST, LEFT = 0.5, 0.1
"""Share of the misfit beyond noise that may stay with a mistake alone, and jointly with one part of the machine."""
MISFIT, FEWEST = 2.0, 6
"""Misfit per reading, in noise variances, below which nothing is looked for; readings that must be there."""
BETTER = 0.5
"""Share of what the best part of the machine leaves that a mistake may leave."""
SAME = 0.1
"""Relative difference of what two mistakes leave below which the readings do not distinguish them."""
KEPT = 2.0
"""Rms of a check, over the noise, up to which it holds."""
ROWS = 400
"""Rows that are judged at most."""


@dataclass(frozen=True, eq=False)
class Found:
    """A mistake and the experiment without it."""

    slip: Slip
    experiment: Experiment


@dataclass(frozen=True, eq=False)
class Judged:
    """A mistake, and shares of the misfit beyond noise."""

    hypothesis: Hypothesis
    left: float
    """What stays with it."""
    beside: float
    """What stays with it and the best single part of the machine."""


@dataclass(frozen=True, eq=False)
class Readings:
    """Readings, and what each single part of the machine would change in them."""

    predictor: Predictor
    plan: Plan
    noise: Noise
    problem: Problem
    screen: Screen

    @staticmethod
    def of(predictor: Predictor, plan: Plan) -> Readings:
        """With the noise of readings that do not stand alone."""
        e = predictor.experiment
        noise, _ = without_suspects(e, plan.base)
        problem = Problem.of(e, noise.sigma, plan.base)
        return Readings(predictor, plan, noise, problem, Screen.of(problem, plan.stack))

    @property
    def experiment(self) -> Experiment:
        """The experiment."""
        return self.predictor.experiment


def find_slip(s: Readings) -> Found | None:
    """The mistake in the readings, or nothing."""
    e = s.experiment
    plain = e.frame != "unknown" and e.tool != "unknown" and e.seen is None and not e.absolute
    if not plain or not np.isfinite(s.plan.base[e.read]).any():
        return None
    sigma = quiet(e, s.noise)
    problem = Problem.of(e, sigma, s.plan.base)
    misfit = problem.residual(s.plan.base)
    of = float(misfit @ misfit)
    if len(problem) < FEWEST or of < MISFIT * problem.freedom:
        return None
    judged = [j for j in _judged(s, e, sigma, s.plan.base) if j.beside < LEFT]
    if not judged:
        return None
    slack = max(SAME * min(j.beside for j in judged), 3.0 * (2.0 * problem.freedom) ** 0.5 / of)
    best = min(j.beside for j in judged)
    near = sorted(
        (j for j in judged if j.beside <= best + slack), key=lambda j: (j.hypothesis.changes, j.left)
    )
    first = near[0]
    h = first.hypothesis
    # shifted rows look like noise where they are repeats: of that the noise of the readings holds too much
    noise = float(np.nanmedian((sigma / s.noise.sigma) ** 2))
    if (h.physical or h.kind != "factor") and first.beside > BETTER * best_part(
        s, noise * problem.freedom
    ) - slack:
        return None
    same = dict.fromkeys(
        j.hypothesis.check
        for j in near[1:]
        if j.hypothesis.changes <= h.changes and j.hypothesis.check != h.check
    )
    after = h.undo(e) if h.undo else e
    slip = Slip(
        h.kind,
        h.seen,
        h.check,
        tuple(same)[:3],
        first.left,
        h.undo is not None,
        _evidence(e, after),
        h.factor,
    )
    return Found(slip, after)


def _judged(s: Readings, e: Experiment, sigma: Floats, base: Floats) -> list[Judged]:
    """Mistakes that take away enough to be one, jointly with a fault that the machine may have as well."""
    predictor = s.predictor
    if len(e) > ROWS:
        e, base, sigma = e.rows(np.arange(ROWS)), base[:ROWS], sigma[:ROWS]
        predictor = Predictor(predictor.machine, e, threads=predictor.threads)
    problem = Problem.of(e, sigma, base)
    out = []
    for h in _all(s, predictor, problem, base):
        left = _left(e, sigma, base, h, problem)
        if left < MOST:
            beside = min(left, _beside(s, h)) if len(e) == len(s.experiment) else left
            out.append(Judged(h, left, beside))
    return out


def _beside(s: Readings, h: Hypothesis) -> float:
    """Share of the misfit beyond noise that stays with a mistake in the readings and the best part of the machine."""
    problem, e = s.problem, s.experiment
    if h.kind == "factor" and h.factor is not None and h.undo is None:
        return 1.0
    there = h.undo(e) if h.undo is not None else e
    if not np.array_equal(there.wrench[: len(there)], e.wrench[: len(there)]) or h.keep is not None:
        return 1.0
    gap = there.reading - s.plan.base
    if not np.isfinite(gap[problem.index]).all():
        return 1.0
    misfit = problem.residual(s.plan.base)
    residual = problem.white(np.nan_to_num(gap))
    scale = 1.0 if h.factor is None else abs(h.factor)
    left = scale**2 * (float(residual @ residual) - _gain(s, residual))
    return _excess(left, float(misfit @ misfit), problem.freedom)


def _excess(left: float, of: float, freedom: float) -> float:
    """Share of a chi-square beyond noise."""
    return max(left - freedom, 0.0) / max(of - freedom, 1e-300)


def quiet(e: Experiment, noise: Noise) -> Floats:
    """(n, c) the least noise that repeats show where rows may be shifted: those of other rows look like noise."""
    floors = [noise.floor]
    for step in steps(e):
        try:
            floors.append(noise_of(moved(e, step)).floor)
        except StiffmapError:
            continue
    least = np.fmin.reduce(floors)
    return np.asarray(noise.sigma * np.where(noise.floor > 0, least / noise.floor, 1.0))


def _all(s: Readings, predictor: Predictor, problem: Problem, base: Floats) -> Iterator[Hypothesis]:
    e = predictor.experiment
    shown = coordinates(e, base)
    if e.quantity == "deflection" or _orthogonal(e):
        yield from gauges(e, shown)
        yield from shifts(e, shown)
    if e.quantity == "deflection":
        yield from factors(e, problem, base, partial(left_beside, s))
        if e.wrench[:, :3].any():
            yield from loads(predictor)


def _orthogonal(e: Experiment) -> bool:
    """Whether rows have poses of their own."""
    return e.command is None and int(e.groups.max()) > 0


def _left(e: Experiment, sigma: Floats, base: Floats, h: Hypothesis, problem: Problem) -> float:
    """Share of the misfit beyond noise that stays with a mistake, on the rows that it speaks of."""
    own = problem if h.keep is None else Problem.of(e, sigma, base, h.keep)
    values = []
    for prediction in (h.prediction, base):
        gap = own.white(e.reading - np.where(np.isfinite(prediction), prediction, e.reading))
        values.append(float(gap @ gap))
    return _excess(values[0], values[1], own.freedom)


def best_part(s: Readings, freedom: float) -> float:
    """Share of the misfit beyond noise that the best single part of the machine leaves."""
    residual = s.problem.residual(s.plan.base)
    of = float(residual @ residual)
    return _excess(of - _gain(s, residual), of, freedom)


def left_beside(s: Readings, factor: float, axes: tuple[int, ...]) -> float:
    """Chi-square that the best single part of the machine leaves where some channels read `factor` times too much."""
    prediction = s.plan.base.copy()
    prediction[:, axes] *= factor
    residual = s.problem.residual(prediction)
    return float(residual @ residual) - _gain(s, residual)


def _gain(s: Readings, residual: Floats) -> float:
    """What the best single part of the machine takes from chi-square, by linear screening within its bounds."""
    screen = s.screen
    if not len(screen.variants):
        return 0.0
    gains = screen.delta_chi2(residual[:, None])[:, 0]
    for i in np.argsort(-gains):
        v = screen.variants[int(i)]
        if get(v.candidate.kind).measurement:
            continue
        if v.start is not None or _possible(screen, int(i), residual):
            return float(gains[i])
    return 0.0


def _possible(screen: Screen, i: int, residual: Floats) -> bool:
    """Whether the values that would explain most are within the bounds of their parameters."""
    numbers = screen.variants[i].candidate.linear
    values = [
        float(p.null or 0.0) + float(v) * p.scale
        for p, v in zip(numbers, screen.estimate(i, residual), strict=True)
    ]
    return all(p.lower <= v <= p.upper for p, v in zip(numbers, values, strict=True))


def _evidence(before: Experiment, after: Experiment) -> tuple[str, ...]:
    """Reciprocity and linearity, which need no model, before and after."""
    out = []
    first, second = _checks(before), _checks(after)
    for name in ("reciprocity", "linearity"):
        one, other = first.get(name, np.nan), second.get(name, np.nan)
        if not np.isfinite(one):
            continue
        text = f"{name} holds" if one < KEPT else f"{name} is violated {one:.2g} times the noise"
        if one >= KEPT and np.isfinite(other):
            text += (
                ", and holds once it is undone" if other < KEPT else f", {other:.2g} times once it is undone"
            )
        out.append(text)
    return tuple(out)


def _checks(e: Experiment) -> dict[str, float]:
    """Rms of each check over the noise."""
    return {c.name: c.rms for c in checks(e, e.reading, noise_of(e).sigma, np.ones(len(e), bool))}
