"""Which effect explains the frequencies of tap tests, and static readings with them (docs/theory.md V8).

Every effect that changes stiffness or mass is fitted at every place of the machine. The numbers of the machine file that are
uncertain move within their uncertainty in every fit, so that none of them passes for a cause.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.stats import chi2

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.experiment import Experiment
from stiffmap.identification.candidates.candidates import Candidate
from stiffmap.identification.inference.optimum import Optimum, covariance, differences, optimum, possible
from stiffmap.identification.taps.causes import causes, scaled, term
from stiffmap.identification.taps.predict import predict_taps
from stiffmap.identification.taps.problem import LEAST, STEP, STEPS, TapsProblem
from stiffmap.identification.taps.table import TapTest
from stiffmap.solve.machine import Machine, takes_machine

SIGNIFICANT = 1e-3
"""Probability with which the best of all candidates may be one where nothing is missing."""
UNLIKELY = 0.05
"""Probability below which readings do not fit the machine, and with which a cause that is only the likeliest may be chance."""
ALIKE = 6.0
"""Chi-squares of candidates nearer than this cannot be distinguished."""
DISAGREE = 3.0
"""Standard deviations between what statics and frequencies say."""
REFINED = 5
"""Candidates whose fit leaves the uncertain numbers free."""
STARTS = (-1.5, -0.7, -0.2, 0.2, 0.7, 1.2, 1.7)
"""Logarithms of a factor, of which the best begins its fit."""
SIZES = (-10.0, -3.0, -1.0, 0.05, 1.0, 3.0, 10.0, 30.0)
"""The same of a number whose null is zero, in typical sizes."""
FEWEST = 16
"""Candidates that are fitted at least; the others promise less."""


@dataclass(frozen=True)
class Explained:
    """One candidate, fitted."""

    place: Candidate
    parameters: dict[str, float]
    """SI."""
    u: dict[str, float]
    chi2: float
    """Of all readings by their noise, and of the uncertain numbers by their uncertainty."""
    statics: float | None = None
    """Parameter by static readings alone; None: not both were there."""
    taps: float | None = None
    """The same by frequencies alone."""
    disagreement: float | None = None
    """Standard deviations between the two."""
    machine: Machine | None = field(default=None, repr=False)
    off: Floats | None = field(default=None, repr=False)
    """Uncertain numbers of the fit, in standard uncertainties."""

    @property
    def candidate(self) -> str:
        """Kind, element and legs in words."""
        return str(self.place)


@dataclass(frozen=True)
class TapDiagnosis:
    """What explains a tap test; `named` is None where nothing has to, or nothing does."""

    before: float
    """Chi-square of the machine as it is."""
    readings: int
    named: Explained | None
    alike: tuple[Explained, ...]
    """Candidates that the readings cannot distinguish from the best, which is the first."""
    sentence: str

    def as_plain(self) -> dict[str, Any]:
        """Data of JSON."""
        return {
            "sentence": self.sentence, "chi2_before": self.before, "readings": self.readings,
            "named": None if self.named is None else self.named.candidate,
            "candidates": [
                {n: getattr(e, n) for n in ("candidate", "parameters", "u", "chi2", "statics", "taps", "disagreement")}
                for e in self.alike
            ],
        }  # fmt: skip


@takes_machine
def explain_taps(
    machine: Machine,
    taps: TapTest,
    statics: Experiment | None = None,
    *,
    default_u: float = 0.05,
    only: Sequence[str] | None = None,
) -> TapDiagnosis:
    """The effect that the frequencies of a tap test ask for, with static readings where there are any.

    Parameters
    ----------
    taps
        From `load_taps`.
    statics
        An experiment of the same machine (deflections or positions); the same parameter must then explain both.
    default_u
        Standard uncertainty of a mass that declares none, relative.
    only
        Kinds of effects to try; None: all that frequencies show.

    Raises StiffmapError for bad input.
    """
    problem = TapsProblem(machine, taps, statics, default_u)
    before = problem.settled().chi2
    n = int(problem.used.sum())
    tried = [c for c in causes(problem) if only is None or c.kind in only]
    if not tried:
        raise StiffmapError(f"only: no candidate of {', '.join(only or ())} on {machine.name}")
    remarks = _remarks(problem)
    certain, likely = (chi2.isf(p / len(tried), 1) for p in (SIGNIFICANT, UNLIKELY))
    found: list[Explained] = []
    if before >= min(certain, chi2.isf(UNLIKELY, n)):
        promising = sorted(tried, key=lambda c: -_promise(problem, c))[: max(FEWEST, len(tried) // 3)]
        first = sorted((e for c in promising if (e := _fitted(problem, c))), key=lambda e: e.chi2)[:REFINED]
        found = sorted((_refined(problem, e) for e in first), key=lambda e: e.chi2)
        before = min([before, *(problem.settled(e.off).chi2 for e in found[:2] if e.off is not None)])
    fall, poor = before - found[0].chi2 if found else 0.0, before >= chi2.isf(UNLIKELY, n)
    if fall < (likely if poor else certain):
        lead = "The readings do not fit, and no single effect explains them: chi-square" if poor else (
            "Nothing is missing that these readings show: chi-square"
        )  # fmt: skip
        return TapDiagnosis(before, n, None, (), f"{lead} {before:.1f} of {n} readings.{remarks}")
    best = _both(problem, found[0])
    alike = (best, *(e for e in found[1:] if e.chi2 < best.chi2 + ALIKE))
    fits = best.chi2 < chi2.isf(SIGNIFICANT, n)
    lead = "" if fits else "Not explained by one effect; the best is "
    if fits and fall < certain:
        lead = (
            f"The readings do not fit (chi-square {before:.1f} of {n}), nothing is certain; the likeliest is "
        )
    said = f"{lead}{_sentence(best, alike, before, n)}{remarks}"
    return TapDiagnosis(before, n, best if fits and fall >= certain else None, alike, said)


def _remarks(problem: TapsProblem) -> str:
    """What of the readings has no say, and how damping compares."""
    p, taps, text = predict_taps(problem.machine, problem.taps), problem.taps, ""
    lost = int(np.isnan(p.frequency).sum())
    if lost:
        text += f" {lost} of {len(taps)} rows are not used: their pose cannot be reached, or has no mode left for them."
    noise = int((np.isfinite(taps.direction).all(axis=1) & ~p.voted).sum())
    if noise:
        text += (
            f" The shape of {noise} rows is that of no mode near, as noise is: frequency alone assigns them."
        )
    merged = int((np.isfinite(taps.hammer[:, 0]) & (p.merged > 0)).sum())
    if merged:
        text += f" {merged} rows are several modes in one, of which only the frequency counts."
    off = np.log(taps.ratio / np.maximum(p.ratio, LEAST))
    if np.isfinite(off).any():
        low, high = 100 * np.nanmin(taps.ratio), 100 * np.nanmax(taps.ratio)
        text += (
            f" Damping is {low:.2g} to {high:.2g} %, {np.exp(np.nanmedian(off)):.2f} times the "
            f"{'assumed' if problem.declared.assumed else 'declared'} (median)."
        )
    return text


def _sentence(best: Explained, alike: tuple[Explained, ...], before: float, n: int) -> str:
    values = ", ".join(f"{k} = {v:.4g} ± {best.u[k]:.2g}" for k, v in best.parameters.items())
    text = f"{best.candidate}: {values}; chi-square {before:.1f} before, {best.chi2:.1f} after, {n} readings."
    if len(alike) > 1:
        text += f" These readings cannot distinguish it from: {'; '.join(e.candidate for e in alike[1:])}."
    off = best.disagreement
    if off is not None and off > DISAGREE:
        text += (
            f" Statics and frequencies disagree by {off:.1f} standard deviations (statics {best.statics:.4g}, frequencies "
            f"{best.taps:.4g}): friction, preload, or a servo that holds what creeps at rest."
        )
    elif off is not None:
        text += f" Statics and frequencies agree ({off:.1f} standard deviations)."
    return text


def _promise(problem: TapsProblem, c: Candidate) -> float:
    """Fall of chi-square that one small step promises, to first order."""
    rows, W = problem.whitener()
    r0 = W @ problem.residual()[rows]
    try:
        slope = (W @ problem.residual(term(c, scaled(c.parameters[0])[0](0.1)))[rows] - r0) / 0.1
    except StiffmapError:
        return -1.0
    size = float(slope @ slope)
    return float(slope @ r0) ** 2 / size if size > 0 else -1.0


def _fitted(problem: TapsProblem, c: Candidate, part: str = "") -> Explained | None:
    """With uncertain numbers to first order; None where the readings do not identify it."""
    p = c.parameters[0]
    to, low, high = scaled(p)
    rows, W = problem.whitener(part)

    def residual(t: Floats) -> Floats:
        return np.asarray(W @ problem.residual(term(c, to(float(t[0]))))[rows])

    starts = [t for t in (STARTS if p.null == 1.0 else SIZES) if low < t < high] or [low]
    least, start = min((float((possible(residual, np.array([t]), 1) ** 2).sum()), t) for t in starts)
    if not np.isfinite(least):
        return None
    bounds = np.array([low]), np.array([high])
    fit = optimum(residual, np.array([start]), bounds, lambda t: differences(residual, t, STEP), STEPS)
    found = _explained(problem, c, fit)
    return found if np.isfinite(found.u[p.name]) else None


def _refined(problem: TapsProblem, e: Explained) -> Explained:
    """The fit again with the uncertain numbers as unknowns of their own, which are not taken to be small."""
    p = e.place.parameters[0]
    to, low, high = scaled(p)
    value = e.parameters[p.name]
    start = np.log(value) if p.null == 1.0 else value / p.scale
    begin = np.r_[start, np.zeros(len(problem.numbers))]
    return _explained(problem, e.place, problem.settled(begin, lambda t: term(e.place, to(t)), (low, high)))


def _explained(problem: TapsProblem, c: Candidate, fit: Optimum) -> Explained:
    """A candidate where the first number of a fit is its own, and further ones are the uncertain numbers."""
    p, off = c.parameters[0], fit.x[1:]
    value = scaled(p)[0](float(fit.x[0]))
    u = float(np.sqrt(covariance(fit.jacobian)[0][0, 0])) * (value if p.null == 1.0 else p.scale)
    machine, _ = problem.real(term(c, value), off)
    return Explained(c, {p.name: value}, {p.name: u}, fit.chi2, machine=machine, off=off)


def _both(problem: TapsProblem, best: Explained) -> Explained:
    """The same parameter by statics alone and by frequencies alone."""
    if problem.statics is None:
        return best
    one, two = _fitted(problem, best.place, "statics"), _fitted(problem, best.place, "taps")
    if one is None or two is None:
        return best
    name = best.place.parameters[0].name
    a, b = one.parameters[name], two.parameters[name]
    return replace(
        best, statics=a, taps=b, disagreement=abs(a - b) / float(np.hypot(one.u[name], two.u[name]))
    )
