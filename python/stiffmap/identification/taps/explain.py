"""Which effect explains the frequencies of tap tests, and static readings with them (docs/theory.md V8).

Every effect that changes stiffness or mass is fitted at every place of the machine. The numbers of the machine file that are
uncertain move within their uncertainty in every fit, so that none of them passes for a cause.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import chi2

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.experiment import Experiment
from stiffmap.identification.diagnosis.candidates.candidates import Candidate, of_kind
from stiffmap.identification.taps.problem import STEPS, Problem, Term, slopes_of
from stiffmap.identification.taps.table import TapTest
from stiffmap.model import effects
from stiffmap.model.description import MachineDescription
from stiffmap.model.effects import Parameter
from stiffmap.solve.machine import Machine, takes_machine

KINDS = ("compliance", "joint_compliance", "base_compliance", "tool_compliance")
"""Effects that frequencies show; besides them a mass on the platform."""
PAYLOAD = Parameter("mass", "kg", 0.0, 1e4, 0.0, 1.0, "of a body at the TCP that the machine file leaves out")
SIGNIFICANT = 1e-3
"""Probability with which the best of all candidates may be one where nothing is missing."""
ALIKE = 6.0
"""Chi-squares of candidates nearer than this cannot be distinguished."""
DISAGREE = 3.0
"""Standard deviations between what statics and frequencies say."""
REFINED = 5
"""Candidates whose fit leaves the uncertain numbers free."""
STARTS = (-1.5, -0.7, -0.2, 0.2, 0.7, 1.2, 1.7)
"""Logarithms of a factor, of which the best begins its fit."""
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
    """First parameter by static readings alone, and by frequencies alone, each with its u; None: not both were there."""
    u_statics: float | None = None
    taps: float | None = None
    u_taps: float | None = None
    machine: Machine | None = field(default=None, repr=False)
    off: Floats | None = field(default=None, repr=False)
    """Uncertain numbers of the fit, in standard uncertainties."""

    @property
    def candidate(self) -> str:
        """Kind, element and legs in words."""
        return str(self.place)

    @property
    def disagreement(self) -> float | None:
        """Standard deviations between statics and frequencies."""
        if self.statics is None or self.taps is None or self.u_statics is None or self.u_taps is None:
            return None
        return abs(self.statics - self.taps) / float(np.hypot(self.u_statics, self.u_taps))


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
    problem = Problem(machine, taps, statics, default_u)
    before, _ = problem.settled()
    n = int(problem.used.sum())
    tried = [c for c in _candidates(machine.description) if only is None or c.kind in only]
    if not tried:
        raise StiffmapError(f"only: no candidate of {', '.join(only or ())} on {machine.name}")
    if before < chi2.isf(0.05, n):
        said = f"Nothing is missing that these readings show: chi-square {before:.1f} of {n} readings."
        return TapDiagnosis(before, n, None, (), said)
    promising = sorted(tried, key=lambda c: -_promise(problem, c))[: max(FEWEST, len(tried) // 3)]
    first = sorted((e for c in promising if (e := _fitted(problem, c))), key=lambda e: e.chi2)[:REFINED]
    found = sorted((_refined(problem, e) for e in first), key=lambda e: e.chi2)
    before = min([before, *(problem.settled(start=e.off)[0] for e in found[:2] if e.off is not None)])
    if not found or before - found[0].chi2 < chi2.isf(SIGNIFICANT / len(tried), 1):
        said = "Nothing is missing that these readings show" if before < chi2.isf(SIGNIFICANT, n) else (
            "The readings do not fit, and no single effect explains them"
        )  # fmt: skip
        return TapDiagnosis(before, n, None, (), f"{said}: chi-square {before:.1f} of {n} readings.")
    best = _both(problem, found[0])
    alike = (best, *(e for e in found[1:] if e.chi2 < best.chi2 + ALIKE))
    fits = best.chi2 < chi2.isf(SIGNIFICANT, n)
    return TapDiagnosis(before, n, best if fits else None, alike, _sentence(best, alike, before, n, fits))


def _sentence(best: Explained, alike: tuple[Explained, ...], before: float, n: int, fits: bool) -> str:
    values = ", ".join(f"{k} = {v:.4g} ± {best.u[k]:.2g}" for k, v in best.parameters.items())
    text = f"{best.candidate}: {values}; chi-square {before:.1f} before, {best.chi2:.1f} after, {n} readings."
    if not fits:
        text = f"Not explained by one effect; the best is {text}"
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


def _candidates(d: MachineDescription) -> list[Candidate]:
    found = [c for kind in KINDS for c in of_kind(effects.get(kind), d)]
    found = [
        replace(c, parameters=(p,)) for c in found for p in c.parameters if p.null is not None
    ]  # each number by itself: frequencies are few
    return [*found, Candidate("payload", "platform", (), (PAYLOAD,))]


def _term(c: Candidate, value: float) -> Term:
    return float(value) if c.kind == "payload" else c.term([value])


def _scaled(p: Parameter) -> tuple[Callable[[float], float], float, float]:
    """From a free number to the parameter (factors by their logarithm), and its bounds."""
    if p.null == 1.0:
        return (
            (lambda t: float(np.clip(np.exp(t), p.lower, p.upper))),
            float(np.log(p.lower)),
            float(np.log(p.upper)),
        )
    return (lambda t: float(np.clip(t * p.scale, p.lower, p.upper))), p.lower / p.scale, p.upper / p.scale


def _promise(problem: Problem, c: Candidate) -> float:
    """Fall of chi-square that one small step promises, to first order."""
    to, _, _ = _scaled(c.parameters[0])
    rows, W = problem.whitener()
    r0 = W @ problem.residual()[rows]
    try:
        slope = (W @ problem.residual(_term(c, to(0.1)))[rows] - r0) / 0.1
    except StiffmapError:
        return -1.0
    size = float(slope @ slope)
    return float(slope @ r0) ** 2 / size if size > 0 else -1.0


def _fitted(problem: Problem, c: Candidate, part: str = "") -> Explained | None:
    """With uncertain numbers to first order; None where the readings say nothing of it."""
    p = c.parameters[0]
    to, low, high = _scaled(p)
    rows, W = problem.whitener(part)

    def residual(t: Floats) -> Floats:
        try:
            return np.asarray(W @ problem.residual(_term(c, to(float(t[0]))))[rows])
        except StiffmapError:
            return np.full(int(rows.sum()), 1e3)

    starts = STARTS if p.null == 1.0 else (0.05, 1.0)
    grid = [(float((residual(np.array([t])) ** 2).sum()), t) for t in starts]
    fit = least_squares(
        residual,
        [min(max(min(grid)[1], low), high)],
        bounds=([low], [high]),
        diff_step=1e-4,
        x_scale=0.3,
        max_nfev=25,
    )
    curvature = float((fit.jac**2).sum())
    if not curvature > 0:
        return None
    value, u = to(float(fit.x[0])), 1 / np.sqrt(curvature)
    u *= value if p.null == 1.0 else p.scale
    return Explained(
        c, {p.name: value}, {p.name: float(u)}, float(2 * fit.cost),
        machine=problem.machine_with(_term(c, value)),
    )  # fmt: skip


def _refined(problem: Problem, e: Explained) -> Explained:
    """The fit again with the uncertain numbers as unknowns of their own, which are not taken to be small."""
    p = e.place.parameters[0]
    to, low, high = _scaled(p)
    k = len(problem.numbers)
    value = e.parameters[p.name]
    start = np.clip(np.log(value) if p.null == 1.0 else value / p.scale, low + 1e-9, high - 1e-9)

    def residual(t: Floats) -> Floats:
        try:
            r = problem.residual(_term(e.place, to(float(t[0]))), t[1:])
        except StiffmapError:
            r = np.full(int(problem.used.sum()), 1e3)
        return np.concatenate([r, t[1:]])

    fit = least_squares(
        residual, np.r_[start, np.zeros(k)], slopes_of(residual), x_scale=1.0, max_nfev=STEPS,
        bounds=(np.r_[low, np.full(k, -6.0)], np.r_[high, np.full(k, 6.0)]),
    )  # fmt: skip
    value = to(float(fit.x[0]))
    covariance = np.linalg.pinv(fit.jac.T @ fit.jac)
    u = float(np.sqrt(covariance[0, 0])) * (value if p.null == 1.0 else p.scale)
    machine = problem.machine_with(_term(e.place, value), fit.x[1:])
    return replace(
        e, parameters={p.name: value}, u={p.name: u}, chi2=float(2 * fit.cost), machine=machine, off=fit.x[1:]
    )


def _both(problem: Problem, best: Explained) -> Explained:
    """The same parameter by statics alone and by frequencies alone."""
    if problem.statics is None:
        return best
    one, two = _fitted(problem, best.place, "statics"), _fitted(problem, best.place, "taps")
    if one is None or two is None:
        return best
    name = best.place.parameters[0].name
    return replace(
        best,
        statics=one.parameters[name],
        u_statics=one.u[name],
        taps=two.parameters[name],
        u_taps=two.u[name],
    )
