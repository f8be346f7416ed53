"""Which effect explains the frequencies of tap tests, and static readings with them (docs/theory.md V8).

Every effect that changes stiffness or mass is fitted at every place of the machine. The residuals are whitened by the noise of the
readings and by what the numbers of the machine file leave open, so that no uncertain number passes for a cause.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import chi2

from stiffmap import effects
from stiffmap.broadcasting import Floats
from stiffmap.description import Body, MachineDescription
from stiffmap.diagnosis.candidates.candidates import Candidate, of_kind
from stiffmap.effects import Parameter, apply_records
from stiffmap.errors import StiffmapError
from stiffmap.experiment import Experiment
from stiffmap.experiment.noise.level import noise_of
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.machine import Machine, takes_machine
from stiffmap.maps.uncertainty_edit import moved
from stiffmap.taps.predict import predict_taps
from stiffmap.taps.table import TapTest

KINDS = ("compliance", "joint_compliance", "base_compliance", "tool_compliance")
"""Effects that frequencies show; besides them a mass on the platform."""
PAYLOAD = Parameter("mass", "kg", 0.0, 1e4, 0.0, 1.0, "of a body at the TCP that the machine file leaves out")
SIGNIFICANT = 1e-3
"""Probability with which the best of all candidates may be one where nothing is missing."""
ALIKE = 6.0
"""Chi-squares of candidates nearer than this cannot be told apart."""
DISAGREE = 3.0
"""Standard deviations between what statics and frequencies say."""
MOST_PARAMETERS = 2


@dataclass(frozen=True)
class Explained:
    """One candidate, fitted."""

    candidate: str
    kind: str
    parameters: dict[str, float]
    """SI."""
    u: dict[str, float]
    chi2: float
    """Of all readings, whitened."""
    statics: float | None = None
    """First parameter by static readings alone, and by frequencies alone, each with its u; None: not both were there."""
    u_statics: float | None = None
    taps: float | None = None
    u_taps: float | None = None
    machine: Machine | None = field(default=None, repr=False)

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
    """Candidates that the readings cannot tell from the best, which is the first."""
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
    problem = _Problem(machine, taps, statics, default_u)
    r0 = problem.residual(())
    before = float(r0 @ r0)
    tried = [c for c in _candidates(machine.description) if only is None or c.kind in only]
    if not tried:
        raise StiffmapError(f"only: no candidate of {', '.join(only or ())} on {machine.name}")
    promising = sorted(tried, key=lambda c: -_promise(problem, c, r0))[: max(8, len(tried) // 4)]
    found = sorted((e for c in promising if (e := _fitted(problem, c))), key=lambda e: e.chi2)
    n = len(r0)
    enough = chi2.isf(SIGNIFICANT / len(tried), 1)
    if not found or before - found[0].chi2 < enough:
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
        text += f" These readings cannot tell it from: {'; '.join(e.candidate for e in alike[1:])}."
    off = best.disagreement
    if off is not None and off > DISAGREE:
        text += (
            f" Statics and frequencies disagree by {off:.1f} standard deviations (statics {best.statics:.4g}, frequencies "
            f"{best.taps:.4g}): friction, preload, or a servo that holds what creeps at rest."
        )
    elif off is not None:
        text += f" Statics and frequencies agree ({off:.1f} standard deviations)."
    return text


@dataclass(eq=False)
class _Problem:
    machine: Machine
    taps: TapTest
    statics: Experiment | None
    default_u: float
    predictor: Predictor | None = None

    def __post_init__(self) -> None:
        first = [self._frequencies(self.machine.description)]
        noise = [self.taps.u / self.taps.frequency]
        if self.statics is not None:
            self.predictor = Predictor(self.machine, self.statics)
            self.keep = self.statics.read & np.isfinite(self.predictor(()))
            first.append(self._deflections(self.machine))
            noise.append(noise_of(self.statics).sigma[self.keep])
        self.split = len(first[0])
        self.used = np.isfinite(np.concatenate(first))
        base = np.concatenate(first)
        columns = [base * 0.0]
        for key, delta in uncertain_numbers(self.machine.description, self.default_u):
            other = moved(self.machine.description, key, delta)
            if other is not None:
                columns.append(self._raw(Machine(other, like=self.machine)) - base)
        J = np.nan_to_num(np.stack(columns, axis=1))[self.used]
        covariance = np.diag(np.concatenate(noise)[self.used] ** 2) + J @ J.T
        self.whiten = np.linalg.inv(np.linalg.cholesky(covariance))

    def _frequencies(self, d: MachineDescription) -> Floats:
        return np.asarray(np.log(predict_taps(Machine(d, like=self.machine), self.taps).frequency / self.taps.frequency))

    def _deflections(self, machine: Machine) -> Floats:
        assert self.statics is not None and self.predictor is not None
        of = self.predictor if machine is self.machine else Predictor(machine, self.statics)
        return np.asarray((of(()) - self.statics.reading)[self.keep])

    def _raw(self, machine: Machine) -> Floats:
        parts = [self._frequencies(machine.description)]
        if self.statics is not None:
            parts.append(self._deflections(machine))
        return np.concatenate(parts)

    def machine_with(self, term: object) -> Machine:
        """The machine with an effect, or with a body at its TCP."""
        d = self.machine.description
        if isinstance(term, float):
            body = Body("tapped_load", term)
            return Machine(replace(d, platform=(*d.platform, body)), like=self.machine)
        return Machine(apply_records(d, [term]), like=self.machine)  # type: ignore[list-item]

    def residual(self, term: object, part: str = "") -> Floats:
        """Whitened; `part` statics or taps: those readings alone, still with what all share."""
        raw = self._raw(self.machine if term == () else self.machine_with(term))[self.used]
        raw = np.nan_to_num(raw, nan=3.0)
        if not part:
            return np.asarray(self.whiten @ raw)
        take = np.flatnonzero(self.used) < self.split
        take = take if part == "taps" else ~take
        W = np.linalg.inv(self.whiten)
        own = (W @ W.T)[np.ix_(take, take)]
        return np.asarray(np.linalg.solve(np.linalg.cholesky(own), raw[take]))


def uncertain_numbers(d: MachineDescription, default_u: float) -> list[tuple[str, float]]:
    """Names and standard uncertainties (SI): those that the machine file declares, and masses by `default_u`."""
    from stiffmap.description.tree import all_elements

    declared = dict(d.uncertainty)
    masses = {f"{full}/mass": default_u * e.mass for full, e in all_elements(d) if isinstance(e, Body) and e.mass > 0}
    return [*declared.items(), *((k, u) for k, u in masses.items() if k not in declared)]


def _candidates(d: MachineDescription) -> list[Candidate]:
    found = [c for kind in KINDS for c in of_kind(effects.get(kind), d)]
    found = [
        replace(c, parameters=(p,)) for c in found for p in c.parameters if p.null is not None
    ]  # each number by itself: frequencies are few
    return [*found, Candidate("payload", "platform", (), (PAYLOAD,))]


def _term(c: Candidate, value: float) -> object:
    return float(value) if c.kind == "payload" else c.term([value])


def _steps(c: Candidate) -> tuple[Callable[[float], float], Callable[[float], float], float]:
    """From a free number to the parameter and back, and a first step: factors by their logarithm."""
    p = c.parameters[0]
    if p.null == 1.0:
        return (lambda t: float(np.clip(np.exp(t), p.lower, p.upper))), (lambda v: float(np.log(v))), 0.1
    return (lambda t: float(np.clip(t * p.scale, p.lower, p.upper))), (lambda v: v / p.scale), 0.05


def _promise(problem: _Problem, c: Candidate, r0: Floats) -> float:
    """Fall of chi-square that one small step promises."""
    to, _, step = _steps(c)
    try:
        slope = (problem.residual(_term(c, to(step))) - r0) / step
    except StiffmapError:
        return -1.0
    size = float(slope @ slope)
    return float(slope @ r0) ** 2 / size if size > 0 else -1.0


def _fitted(problem: _Problem, c: Candidate, part: str = "") -> Explained | None:
    to, _, step = _steps(c)
    p = c.parameters[0]
    low = np.log(p.lower) if p.null == 1.0 else p.lower / p.scale
    high = np.log(p.upper) if p.null == 1.0 else p.upper / p.scale

    def residual(t: Floats) -> Floats:
        try:
            return problem.residual(_term(c, to(float(t[0]))), part)
        except StiffmapError:
            return np.full(len(problem.residual((), part)), 1e3)

    starts = [step] if p.null != 1.0 else [0.1, 0.8, -0.8]
    fits = [
        least_squares(residual, [min(max(s, low), high)], bounds=([low], [high]), diff_step=1e-4, x_scale=0.3, max_nfev=25)
        for s in starts
    ]
    fit = min(fits, key=lambda f: f.cost)
    curvature = float((fit.jac**2).sum())
    if curvature <= 0:
        return None
    value, u = to(float(fit.x[0])), 1 / np.sqrt(curvature)
    u *= value if p.null == 1.0 else p.scale
    return Explained(
        f"{c} ({p.name})" if len(c.parameters) > 1 or p.null != 1.0 else str(c), c.kind, {p.name: value}, {p.name: float(u)},
        float(2 * fit.cost), machine=problem.machine_with(_term(c, value)),
    )  # fmt: skip


def _both(problem: _Problem, best: Explained) -> Explained:
    """The same parameter by statics alone and by frequencies alone."""
    if problem.statics is None:
        return best
    c = next(c for c in _candidates(problem.machine.description) if best.candidate.startswith(str(c)) and c.parameters[0].name in best.parameters)  # fmt: skip
    one, two = _fitted(problem, c, "statics"), _fitted(problem, c, "taps")
    if one is None or two is None:
        return best
    name = c.parameters[0].name
    return replace(
        best, statics=one.parameters[name], u_statics=one.u[name], taps=two.parameters[name], u_taps=two.u[name]
    )
