"""Which mistake of writing or mounting explains readings better than any part of the machine does.

A mistake is named only where it takes away all but `LEFT` of the squared misfit, alone or with one part of the machine; what
parts of the machine may show as well (a factor of two) only where no single part comes near that and no two do better.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.noise.checks import checks
from stiffmap.experiment.noise.level import Noise, noise_of
from stiffmap.experiment.noise.outliers import without_suspects
from stiffmap.experiment.noise.whitening import LinearProblem
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.candidates.sensitivity import CandidatePlan, Variant
from stiffmap.identification.diagnosis.slips.axes import Hypothesis, Slip, gauges, loads, moved, shifts, steps
from stiffmap.identification.diagnosis.slips.factors import factors
from stiffmap.identification.inference.places import Shape, of_every_two, shape_of, side_by_side
from stiffmap.model.effects import get

MOST, LEFT = 0.5, 0.1
"""Share of the misfit beyond noise that may stay with a mistake alone, and jointly with one part of the machine."""
MISFIT, FEWEST = 2.0, 6
"""Misfit per reading, in noise variances, below which nothing is looked for; readings that must be there."""
BETTER = 0.5
"""Share of what the best part of the machine leaves that a mistake may leave."""
PAIRED = 24
"""Parts of the machine, those that take most alone, with which each other one is tried; effort only."""
DUST = 1e-13
"""Of the length of a direction, squared: parts that differ by less show the same."""
SAME = 0.1
"""Relative difference of what two mistakes leave below which the readings do not distinguish them."""
KEPT = 2.0
"""Rms of a check, over the noise, up to which it holds."""
ROWS = 400
"""Rows that are judged at most."""


@dataclass(frozen=True, eq=False)
class Screen:
    """The directions of all parts of the machine in whitened readings (N,)."""

    shapes: tuple[Shape, ...]
    white: tuple[Floats, ...]
    """(N, p) columns of each."""

    @staticmethod
    def of(problem: LinearProblem, variants: Sequence[Variant]) -> Screen:
        """Of variants that are no fault of the measurement; the readings of the problem are the first of their own."""
        parts = [v for v in variants if not get(v.candidate.kind).measurement]
        white = [problem.white_lines(v.lines(np.arange(len(problem.used)))) for v in parts]
        found = [(s, w) for v, w in zip(parts, white, strict=True) if (s := shape_of(v, w)) is not None]
        return Screen(tuple(s for s, _ in found), tuple(w for _, w in found))

    def gain(self, residual: Floats) -> float:
        """What the best part takes from chi-square of a residual (N,), its strengths within their bounds."""
        gains = self._gains(residual)
        best = (k for k in np.argsort(-gains) if np.isfinite(self._left_by(residual, k)))
        return float(gains[k]) if (k := next(best, None)) is not None else 0.0

    def left(self, residual: Floats) -> float:
        """Chi-square that the best part leaves of a residual (N,)."""
        return float(residual @ residual) - self.gain(residual)

    def left_by_two(self, residual: Floats) -> float:
        """Chi-square that the best two parts together leave of a residual (N,)."""
        best, of = self.left(residual), float(residual @ residual)
        parts = np.argsort(-self._gains(residual))
        if len(parts) < 2:
            return best
        factor = side_by_side([self.shapes[k] for k in parts])
        _, count, rank = factor.shape
        flat = factor.reshape(len(residual), -1)
        both = np.stack(np.triu_indices(min(PAIRED, count), 1, count), axis=1)
        along = (flat.T @ residual).reshape(count, rank)[both].reshape(-1, 2 * rank)
        held = of_every_two(flat, rank, both) + DUST * len(residual) * np.eye(2 * rank)
        taken = np.sum(along * np.linalg.solve(held, along[..., None])[..., 0], axis=-1)
        for k in np.argsort(-taken):
            if of - taken[k] >= best:  # whatever their bounds
                break
            best = min(best, self._left_by(residual, *parts[both[k]]))
        return best

    def _gains(self, residual: Floats) -> Floats:
        """What each part takes from chi-square, whatever its bounds."""
        along = [(s.sign, s.directions.T @ residual) for s in self.shapes]
        return np.array([a @ a if not sign or sign * a[0] > 0.0 else 0.0 for sign, a in along])

    def _left_by(self, residual: Floats, *parts: int) -> float:
        """Chi-square that parts leave together; infinite where a strength that explains most is not within its bounds."""
        white = np.hstack([self.white[k] for k in parts])
        strengths = np.linalg.lstsq(white, residual, rcond=1e-5)[0]
        left = float(np.sum((residual - white @ strengths) ** 2))
        for v in (self.shapes[k].variant for k in parts):
            own, strengths = np.split(strengths, [len(v.sign)])
            known = v.candidate.strengths(own) if v.start is None else ()
            if not all(p.lower <= x <= p.upper for p, x in known):
                return np.inf
        return left


class SlipReadings:
    """The first rows of an experiment, at most `ROWS`, and what each single part of the machine would change in them.

    base (n, c) is the prediction of the declared machine, sigma (n, c) the noise of readings that do not stand alone, least (n, c)
    that of rows that may be shifted, all in m or rad; problem: the readings in noise sigma; screen: the parts of the machine, made
    where they are asked for.
    """

    def __init__(self, predictor: Predictor, plan: CandidatePlan) -> None:
        e = predictor.experiment
        noise, _ = without_suspects(e, plan.base)
        if len(e) > ROWS:
            part = e.rows(np.arange(ROWS))
            predictor = Predictor(predictor.machine, part, threads=predictor.threads)
        self.predictor, self.experiment = predictor, predictor.experiment
        self.base, self.sigma, self.least = plan.base[:ROWS], noise.sigma[:ROWS], quiet(e, noise)[:ROWS]
        self.problem = LinearProblem.of(self.experiment, self.sigma, self.base)
        self.screen = cache(partial(Screen.of, self.problem, plan.variants))


def find_slip(predictor: Predictor, plan: CandidatePlan) -> tuple[Slip, Experiment] | None:
    """The mistake in the readings of an experiment, and the experiment without it; or nothing."""
    whole = predictor.experiment
    plain = whole.frame != "unknown" and whole.tool != "unknown" and whole.seen is None and not whole.absolute
    if not plain or not np.isfinite(plan.base[whole.read]).any():
        return None
    s = SlipReadings(predictor, plan)
    e, sigma = s.experiment, s.least
    problem = LinearProblem.of(e, sigma, s.base)
    misfit = problem.residual(s.base)
    of = float(misfit @ misfit)
    if len(problem) < FEWEST or of < MISFIT * problem.freedom:
        return None
    judged = [j for j in _judged(s, problem) if j[2] < LEFT]
    if not judged:
        return None
    best = min(with_part for *_, with_part in judged)
    slack = max(SAME * best, 3.0 * (2.0 * problem.freedom) ** 0.5 / of)
    alike = (j for j in judged if j[2] <= best + slack)
    (h, left, with_part), *others = sorted(alike, key=lambda j: (j[0].changes, j[1]))
    # shifted rows look like noise where they are repeats: of that the noise of the readings holds too much
    noise = float(np.nanmedian((sigma / s.sigma) ** 2))
    residual, parts = s.problem.residual(s.base), s.screen()
    one, two = (
        _excess(x, float(residual @ residual), noise * problem.freedom)
        for x in (parts.left(residual), parts.left_by_two(residual))
    )
    possible = h.physical or h.kind != "factor"
    if possible and with_part > min(BETTER * one - slack, two + slack):
        return None
    also = (o.check for o, *_ in others if o.changes <= h.changes)
    same = tuple(dict.fromkeys(check for check in also if check != h.check))[:3]
    after = h.undo(whole) if h.undo else whole
    undone, evidence = h.undo is not None, _evidence(whole, after)
    return Slip(h.kind, h.seen, h.check, same, left, undone, evidence, h.factor), after


def _judged(s: SlipReadings, problem: LinearProblem) -> Iterator[tuple[Hypothesis, float, float]]:
    """Mistakes that take away enough to be one, with the shares of the misfit beyond noise that stay with each alone, and jointly with
    the best single fault that the machine may have as well."""
    for h in _hypotheses(s, problem):
        left = _left(h, problem)
        if left < MOST:
            yield h, left, min(left, _beside(s, h))


def _beside(s: SlipReadings, h: Hypothesis) -> float:
    """Share of the misfit beyond noise that stays with a mistake in the readings and the best part of the machine."""
    problem, e = s.problem, s.experiment
    if h.undo is None or h.keep is not None or h.setup is not None:
        return 1.0
    there = h.undo(e)
    gap = there.reading - s.base
    if not (np.array_equal(there.wrench, e.wrench) and np.isfinite(gap[problem.index]).all()):
        return 1.0
    misfit = problem.residual(s.base)
    residual = problem.white(np.nan_to_num(gap))
    scale = 1.0 if h.factor is None else abs(h.factor)
    return _excess(scale**2 * s.screen().left(residual), float(misfit @ misfit), problem.freedom)


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


def _hypotheses(s: SlipReadings, problem: LinearProblem) -> Iterator[Hypothesis]:
    """All mistakes that are tried; of positions only where rows have poses of their own."""
    e = s.experiment
    if e.quantity == "deflection" or (e.command is None and int(e.groups.max()) > 0):
        yield from gauges(e, s.base)
        yield from shifts(e, s.base)
    if e.quantity == "deflection":
        yield from factors(e, problem, s.base, lambda p: s.screen().left(s.problem.residual(p)))
        if e.wrench[:, :3].any():
            yield from loads(s.predictor)


def _left(h: Hypothesis, problem: LinearProblem) -> float:
    """Share of the misfit beyond noise that stays with a mistake, on the rows that it speaks of."""
    e, base = problem.experiment, problem.base
    own = problem if h.keep is None else LinearProblem.of(e, problem.sigma, base, h.keep)
    values = []
    for prediction in (h.prediction, base):
        gap = own.white(e.reading - np.where(np.isfinite(prediction), prediction, e.reading))
        values.append(float(gap @ gap))
    return _excess(values[0], values[1], own.freedom)


def _evidence(before: Experiment, after: Experiment) -> tuple[str, ...]:
    """Reciprocity and linearity, which need no model, before and after: rms over the noise."""
    out = []
    first, second = (
        {c.name: c.rms for c in checks(e, e.reading, noise_of(e).sigma, np.ones(len(e), bool))}
        for e in (before, after)
    )
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
