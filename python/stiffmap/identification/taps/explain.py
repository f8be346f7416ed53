"""Which effects explain the frequencies of tap tests, and static readings with them: the inference of all other readings.

Every effect that changes stiffness or mass may be at every place of the machine. A frequency bends with the size of an effect, so each
place has the changes by several sizes as its shapes (docs/theory.md V8).
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import combinations, pairwise
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.stats import chi2

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.common.one_thread import on_one_thread
from stiffmap.experiment import Experiment
from stiffmap.identification.candidates.candidates import Candidate
from stiffmap.identification.candidates.sensitivity import Variant
from stiffmap.identification.inference.chosen import Chosen
from stiffmap.identification.inference.columns import Columns
from stiffmap.identification.inference.constants import MOST_EFFECTS, ODDS, RARE
from stiffmap.identification.inference.free import Free
from stiffmap.identification.inference.names import put_instead, searched
from stiffmap.identification.inference.optimum import Optimum, covariance
from stiffmap.identification.inference.places import Place, shape_of
from stiffmap.identification.inference.verdict import judged
from stiffmap.identification.numbers.unknowns import Unknown
from stiffmap.identification.taps.causes import Causes, causes, scaled, together
from stiffmap.identification.taps.predict import predict_taps
from stiffmap.identification.taps.problem import LEAST, TapsProblem
from stiffmap.identification.taps.table import TapTest
from stiffmap.solve.machine import Machine, takes_machine

PARTS = ("statics", "taps")
DISAGREE = 3.0
"""Standard deviations between what statics and frequencies say."""
FACTORS = (-1.5, -0.8, -0.4, -0.15, 0.15, 0.4, 0.8, 1.3, 1.8, 2.4)
"""Logarithms of a factor at which its changes are predicted."""
SIZES = (-10.0, -3.0, -1.0, 1.0, 3.0, 10.0, 30.0)
"""The same of a number whose null is zero, in typical sizes."""
REFINED = 4
"""Causes in the stead of one, and starts of the fit without any, that are fitted; effort only."""
BETWEEN = 16
"""Sizes from one of these to the next, both among them."""


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
    alike: tuple[Explained, ...] = ()
    """Candidates that the readings cannot distinguish from this one."""

    @property
    def candidate(self) -> str:
        """Kind, element and legs in words."""
        return str(self.place)

    @property
    def value(self) -> float:
        """SI."""
        return next(iter(self.parameters.values()))

    @property
    def sd(self) -> float:
        """SI."""
        return next(iter(self.u.values()))

    def by(self, statics: Explained | None = None, taps: Explained | None = None) -> Explained:
        """With its parameter by static readings alone and by frequencies alone, where there are both and each determines it."""
        if statics is None or taps is None:
            return self
        one, two = statics.value, taps.value
        sd = float(np.hypot(statics.sd, taps.sd))
        if not np.isfinite(sd):
            return self
        return replace(self, statics=one, taps=two, disagreement=abs(one - two) / sd)


@dataclass(frozen=True)
class TapDiagnosis:
    """What explains a tap test; `named` is empty where nothing has to, or nothing does."""

    before: float
    """Chi-square of the machine as it is."""
    readings: int
    named: tuple[Explained, ...]
    sentence: str
    fits: bool
    """Whether nothing is left unexplained."""
    machine: Machine | None = field(default=None, repr=False)
    """With the causes that are named, and the uncertain numbers as they fit."""

    def as_plain(self) -> dict[str, Any]:
        """Data of JSON."""
        shown = ("candidate", "parameters", "u", "chi2", "statics", "taps", "disagreement")
        return {
            "sentence": self.sentence, "chi2_before": self.before, "readings": self.readings, "fits": self.fits,
            "named": [
                {n: getattr(e, n) for n in shown} | {"alike": [a.candidate for a in e.alike]} for e in self.named
            ],
        }  # fmt: skip


@takes_machine
@on_one_thread
def explain_taps(
    machine: Machine,
    taps: TapTest,
    statics: Experiment | None = None,
    *,
    default_u: float = 0.05,
    only: Sequence[str] | None = None,
) -> TapDiagnosis:
    """The effects that the frequencies of a tap test ask for, with static readings where there are any.

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
    tried = [c for c in causes(problem) if only is None or c.kind in only]
    if not tried:
        raise StiffmapError(f"only: no candidate of {', '.join(only or ())} on {machine.name}")
    n, remarks, null = int(problem.used.sum()), _remarks(problem), fitted(problem, [])
    slopes = problem.slopes[problem.used]
    declared = Optimum(np.zeros(slopes.shape[1]), problem.residual(), slopes)
    price = 2.0 * float(np.log(ODDS) + np.log(len(tried)))  # chi-square that an effect must be worth
    fits = [null]

    def least() -> FittedCauses:
        noise = max(1.0, min(f.chi2 for f in fits) / n)
        return min(fits, key=lambda f: f.chi2 + noise * price * len(f.named))

    def search(at: FittedCauses) -> bool:
        """Whether further causes leave nothing to explain, or explain nothing more."""
        before = least()
        fits.extend(fitted(problem, s) for s in _searched(problem, tried, at))
        # without causes other modes may be paired from there than from the declared machine
        near = sorted((f for f in fits if f.named), key=lambda f: f.chi2)[:REFINED]
        fits.extend([fitted(problem, (), f.lines.x) for f in near])
        return least().explains or (at is before and least() is before)

    if null.chi2 > price and not search(replace(null, lines=declared)) and not search(null):
        while len(least().named) < MOST_EFFECTS and not search(least()):
            pass
    best, before = least(), min(f.chi2 for f in fits if not f.named)
    if not best.named:
        lead = "Nothing is missing that these readings show" if best.explains else (
            "The readings do not fit, and no effect explains them"
        )  # fmt: skip
        text = f"{lead}: chi-square {before:.1f} of {n} readings.{remarks}"
        return TapDiagnosis(before, n, (), text, best.explains)
    alike = [f for f in fits if f is not best and f.chi2 < best.chi2 + 2.0 * np.log(ODDS)]
    parts = [fitted(problem.only(part), best.causes) for part in PARTS] if statics else []
    named = []
    for k, e in enumerate(best.named):
        known = {o.place for o in best.named if o is not e}
        same = (f for f in alike if len(f.named) == len(best.named) and known < {s.place for s in f.named})
        steads = {s.place: s for f in same for s in f.named if s.place not in {*known, e.place}}
        instead = tuple(sorted(steads.values(), key=lambda s: s.chi2))
        named.append(replace(e.by(*(f.named[k] for f in parts)), alike=instead))
    lead = "" if best.explains else "Not all is explained; "
    text = f"{lead}{_sentence(named, before, best.chi2, n)}{remarks}"
    return TapDiagnosis(before, n, tuple(named), text, best.explains, best.machine)


@dataclass(frozen=True, eq=False)
class FittedCauses:
    """A set of causes, fitted together with the uncertain numbers."""

    named: tuple[Explained, ...]
    chi2: float
    machine: Machine
    lines: Optimum
    """Where the uncertain numbers (k,) are, the residual (n,) there, and its change (n, k) by each, with the causes as they are."""
    own: Floats
    """(n, causes) change of the residual by each cause."""

    @property
    def explains(self) -> bool:
        """Whether chi-square is no larger than chance lets it be."""
        return bool(chi2.sf(self.chi2, len(self.lines.residual)) > RARE)

    @property
    def causes(self) -> Causes:
        """SI."""
        return [(e.place, e.value) for e in self.named]


def _searched(problem: TapsProblem, tried: Sequence[Candidate], at: FittedCauses) -> list[Causes]:
    """Further causes that have a name where readings follow the uncertain numbers along straight lines from a fit, and what would
    do in the stead of each; all of them, and some, with the causes of the fit and without."""
    columns = _columns(problem, tried, at)

    def predict(chosen: Sequence[Chosen]) -> Floats:
        try:
            there = problem.residual(together([*at.causes, *_values(chosen)]), at.lines.x)
            return columns.rotated(there - at.lines.residual)
        except StiffmapError:
            return np.full(len(columns), np.nan)

    search = searched(columns, predict)
    named = judged(columns, search).named
    own = _values([n.chosen for n in named])
    sets = [own]
    for k, n in enumerate(named):
        instead = _values([put_instead(search.best.fit, n.chosen, p) for p in n.equivalents[:REFINED]])
        sets += [[*own[:k], v, *own[k + 1 :]] for v in instead]
    some = (part for s in sets for k in range(1, len(s) + 1) for part in combinations(s, k))
    both = (s for part in some for s in (part, (*at.causes, *part)))
    return list({frozenset(c for c, _ in s): s for s in both}.values())


def _columns(problem: TapsProblem, tried: Sequence[Candidate], at: FittedCauses) -> Columns:
    """The readings, by their noise, as the inference takes them."""
    lines, taken = at.lines, [c for c, _ in at.causes]
    m = len(lines.residual)
    spared = Free.across(np.linalg.qr(at.own)[0], np.eye(m))  # causes of the fit move with further ones
    free = spared.matrix
    residual = free.T @ (lines.jacobian @ lines.x - lines.residual)
    bare = Columns.bare(problem.plan, problem.row[problem.used], np.zeros(m, np.intp), spared, residual)
    unknowns = tuple(Unknown(key, key.rpartition("/")[2], "", u) for key, _, u in problem.numbers)
    found = (_place(problem, c, at, free) for c in tried if c not in taken)
    places = tuple(p for p in found if p.shapes)
    return replace(bare, unknowns=unknowns, numbers=free.T @ lines.jacobian, places=places)


def _place(problem: TapsProblem, c: Candidate, at: FittedCauses, free: Floats) -> Place:
    """A candidate with the changes of the readings by its sizes, predicted at some and interpolated between them."""
    lines = at.lines
    p, (to, low, high) = c.parameters[0], scaled(c.parameters[0])
    changes = {0.0: np.zeros(len(lines.residual))}
    for t in FACTORS if p.null == 1.0 else SIZES:
        with suppress(StiffmapError):
            if low < t < high:
                there = together([*at.causes, (c, to(t))])
                changes[t] = problem.residual(there, lines.x) - lines.residual
    knots = sorted(changes)
    sizes = np.unique([np.linspace(*ends, BETWEEN) for ends in pairwise(knots)])
    found = CubicSpline(knots, [changes[t] for t in knots])(sizes) if len(knots) > 1 else ()
    shapes = []
    for t, change in zip(sizes, found, strict=True):
        step = (to(float(t)) - float(p.null or 0.0)) / p.scale
        if step:
            line = change[None] / step
            shapes.append(shape_of(Variant(c, line, np.array([np.sign(step)])), free.T @ line.T))
    return Place(c, tuple(s for s in shapes if s is not None))


def _values(chosen: Sequence[Chosen]) -> Causes:
    """Causes with their values, SI, within their bounds."""
    every = ((c.place.candidate, *c.strengths[0]) for c in chosen)
    return [(cause, float(np.clip(value, p.lower, p.upper))) for cause, p, value in every]


def fitted(problem: TapsProblem, begin: Causes, off: Floats | None = None) -> FittedCauses:
    """Causes near their values with the uncertain numbers free, which are not taken to be small."""
    scales = [scaled(c.parameters[0]) for c, _ in begin]

    def at(x: Floats) -> Causes:
        return [(c, to(float(t))) for (c, _), (to, *_), t in zip(begin, scales, x, strict=True)]

    fit = problem.settled(
        [_free(c, value) for c, value in begin],
        lambda x: together(at(x)),
        [low for _, low, _ in scales],
        [high for *_, high in scales],
        off,
    )
    k, n = len(begin), int(problem.used.sum())
    found = []
    for (c, value), variance in zip(at(fit.x[:k]), np.diag(covariance(fit.jacobian)[0])[:k], strict=True):
        p = c.parameters[0]
        u = float(np.sqrt(variance)) * (value if p.null == 1.0 else p.scale)
        found.append(Explained(c, {p.name: value}, {p.name: u}, fit.chi2))
    machine, _ = problem.real(together(at(fit.x[:k])), fit.x[k:])
    slopes = fit.jacobian[:n]
    lines = Optimum(fit.x[k:], fit.residual[:n], slopes[:, k:])
    return FittedCauses(tuple(found), fit.chi2, machine, lines, slopes[:, :k])


def _free(c: Candidate, value: float) -> float:
    """The number of a fit behind a value: its logarithm where it is a factor."""
    p = c.parameters[0]
    return float(np.log(value)) if p.null == 1.0 else value / p.scale


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


def _sentence(named: Sequence[Explained], before: float, after: float, n: int) -> str:
    sizes = [f"{e.candidate}: {k} = {v:.4g} ± {e.u[k]:.2g}" for e in named for k, v in e.parameters.items()]
    text = f"{'; '.join(sizes)}; chi-square {before:.1f} before, {after:.1f} after, {n} readings."
    for e in named:
        it = "it" if len(named) == 1 else e.candidate
        if e.alike:
            text += (
                f" These readings cannot distinguish {it} from: {'; '.join(a.candidate for a in e.alike)}."
            )
        on = "" if it == "it" else f" on {it}"
        if e.disagreement is not None and e.disagreement > DISAGREE:
            text += (
                f" Statics and frequencies disagree{on} by {e.disagreement:.1f} standard deviations (statics {e.statics:.4g}, "
                f"frequencies {e.taps:.4g}): friction, preload, or a servo that holds what creeps at rest."
            )
        elif e.disagreement is not None:
            text += f" Statics and frequencies agree{on} ({e.disagreement:.1f} standard deviations)."
    return text
