"""Selection of effects: forward, exchange, backward; significance over the whole search."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.noise.whitening import Problem
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.diagnosis.candidates.candidates import Candidate, clash
from stiffmap.identification.diagnosis.candidates.sensitivity import Variant
from stiffmap.identification.diagnosis.clock import Clock
from stiffmap.identification.diagnosis.fitting.fit import evaluate, fit, fit_without
from stiffmap.identification.diagnosis.fitting.model import Model
from stiffmap.identification.diagnosis.fitting.tangents import best_known
from stiffmap.identification.diagnosis.search.screen import Screen, chi2_minus_log_p
from stiffmap.identification.diagnosis.search.significance import ALPHA, needed

MOST_EFFECTS = 4
LARGE = 10.0
"""Scales beyond which parameters without a slope at the null get starts of their own."""
WORTH = 0.5
"""Share of the demanded -ln p that screening must promise before anything is fitted."""
ROUGH = 0.3
"""Change of chi-square that decides nothing between candidates; the one that is chosen is fitted to the end."""
FEWEST = 2
"""Candidates that a search which may only come to an end still fits."""
MARGIN, CLOSE = 15.0, 0.05
"""What linear screening may be wrong by: candidates this near the best get a full fit."""


@dataclass(frozen=True, eq=False)
class Search:
    """What a selection works with."""

    predictor: Predictor
    problem: Problem
    screen: Screen
    """Representatives of the alias classes only, with an empty model."""
    effective_trials: float
    """Number of independent tests that the search is worth."""
    finalists: int = 5
    alpha: float = ALPHA
    clock: Clock = field(default_factory=Clock)
    failed: dict[str, str] = field(default_factory=dict)
    """Candidates whose fit failed, and why; the search goes on without them."""

    @property
    def threshold(self) -> float:
        """-ln p that an effect must have."""
        return needed(self.effective_trials, self.alpha)


@dataclass(frozen=True, eq=False)
class Finalist:
    """A candidate tried through the full equilibrium jointly with the effects in the model."""

    model: Model
    delta_chi2: float
    minus_log_p: float
    """-ln p of such a reduction of chi-square under the model without it."""


@dataclass(frozen=True, eq=False)
class Selection:
    """The model chosen, and what was tried on the way."""

    model: Model
    null: Model
    steps: tuple[str, ...] = field(default=())


def select(search: Search) -> Selection:
    """Effects that the readings demand, one after the other."""
    null = evaluate(Model(), search.predictor, search.problem)
    model = null
    steps: list[str] = []
    search.clock.begin_search()
    try:
        for _ in range(MOST_EFFECTS):
            if search.clock.over:
                break
            if steps and search.clock.tired:
                search.clock.leave_out(f"a further effect in addition to {steps[-1]}")
                break
            search.clock.say(f"an effect in addition to {steps[-1]}" if steps else "a first effect")
            best = best_addition(search, model)
            if best is None or best.minus_log_p < search.threshold:
                break
            model = best.model
            model = backward(search, exchange(search, model))
            steps.append(" + ".join(map(str, model.candidates)))
            if steps.count(steps[-1]) > 1:
                break
    except KeyboardInterrupt:  # the best so far is an answer
        search.clock.stop()
    return Selection(model, null, tuple(steps))


def best_addition(
    search: Search, model: Model, but: Candidate | None = None, least: float = 0.0
) -> Finalist | None:
    """The candidate that explains most jointly with the model, judged by full fits of the best few, `but` one; whoever cannot
    come near a -ln p of `least` is not fitted."""
    found = [f for f in additions(search, model, search.finalists, but=but, least=least) if f.model.usable]
    best = max(found, key=lambda f: f.minus_log_p, default=None)
    return None if best is None else _polished(search, model, best)


def _polished(search: Search, before: Model, best: Finalist) -> Finalist:
    """The finalist with a Jacobian of its own: those that lose need none."""
    model = fit(best.model, search.predictor, search.problem)
    if not model.usable or model.chi2 > best.model.chi2:
        return best
    delta_chi2 = before.chi2 - model.chi2
    return Finalist(model, delta_chi2, minus_log_p_of(delta_chi2, model.sizes()[-1]))


def additions(
    search: Search,
    model: Model,
    number: int,
    margin: float = MARGIN,
    but: Candidate | None = None,
    least: float | None = None,
) -> list[Finalist]:
    """Full fits of what screening puts first: within `margin` (or `CLOSE`) of the best, `but` one that is known.

    least
        -ln p that an addition must come as near to. With it those are left out, too, of which an earlier fit, on other rows
        or at another floor, says that they lose by as much. None: all are fitted.
    """
    if model.residual is None:
        return []
    screen = search.screen.beside(model.tangent())
    minus_log_p = screen.minus_log_p(screen.delta_chi2(model.residual[:, None])[:, 0])
    best_of: dict[Candidate, int] = {}
    order = np.argsort(-minus_log_p)
    firsts = np.sort(np.unique(screen.stack.owner[order], return_index=True)[1])  # the best shape of each
    for i in order[firsts]:
        v = screen.variants[i]
        if (
            minus_log_p[i] > 0
            and v.candidate not in model.candidates
            and not clash(v.candidate, model.candidates)
            and frozenset((*model.candidates, v.candidate)) not in search.clock.given_up
        ):
            best_of.setdefault(v.candidate, int(i))
    top = max(minus_log_p, default=0.0)
    if top < WORTH * search.threshold:
        return []
    picked = [i for i in best_of.values() if minus_log_p[i] > top - max(margin, CLOSE * top)]
    fitted = [i for i in picked[:number] if screen.variants[i].candidate != but]
    if least is not None:
        fitted = _hopeful(search, model, screen, fitted, minus_log_p, margin, least)
    found: list[Finalist] = []
    for i in fitted:
        if found and search.clock.over:
            break
        f = _finalist(search, model, screen, i)
        found.append(f)
        kept = f.minus_log_p / float(minus_log_p[i]) if f.model.usable else 0.0
        search.clock.promises[_beside(model, screen.variants[i].candidate)] = kept
    return found


def _hopeful(
    search: Search,
    model: Model,
    screen: Screen,
    which: list[int],
    promised: Floats,
    margin: float,
    least: float,
) -> list[int]:
    """Of some variants those that may win: what screening promises, times what an earlier fit kept of it."""
    known = {i: search.clock.promises.get(_beside(model, screen.variants[i].candidate)) for i in which}
    likely = {i: float(promised[i]) * k for i, k in known.items() if k is not None}
    top = max([least, *likely.values()])

    def hopeful(minus_log_p: float, than: float) -> bool:
        return minus_log_p >= than - max(margin, CLOSE * than)

    left = [
        i for i in which if (hopeful(likely[i], top) if i in likely else hopeful(float(promised[i]), least))
    ]
    if not search.clock.tired:
        return left
    return sorted(left, key=lambda i: -likely.get(i, float(promised[i])))[:FEWEST]


def _beside(model: Model, candidate: Candidate) -> tuple[frozenset[Candidate], Candidate]:
    return frozenset(model.candidates), candidate


def _finalist(search: Search, model: Model, screen: Screen, i: int) -> Finalist:
    assert model.residual is not None
    variant = screen.variants[i]
    estimate = screen.estimate(i, model.residual)
    flat = ~np.any(screen.columns(i) != 0.0, axis=0)
    starts = start_values(variant, estimate, flat)
    held = np.flatnonzero(flat).tolist() if len(starts) == 1 else []
    begun = [model.plus(variant.candidate, s, held) for s in starts]
    if len(begun) == 1 and not variant.shape:
        begun = [_from_before(search, model, begun[0])]
    near = _near(search.screen, model, i)
    own = range(len(model.values), len(begun[0].values))
    fits = [fit(b, search.predictor, search.problem, near=near, doubtful=own, pays=ROUGH) for b in begun]
    best = min(fits, key=lambda m: m.chi2)
    if not best.usable:
        if any(f.given_up for f in fits):
            named = " + ".join(map(str, best.candidates))
            search.clock.given_up.add(frozenset(best.candidates))
            search.clock.leave_out(
                f"the fit of {named} to its end: its predictions fail or leave the fast path"
            )
        beside = f" in addition to {' + '.join(map(str, model.candidates))}" if model.candidates else ""
        search.failed[f"{variant.candidate}{beside}"] = best.failure
    delta_chi2 = model.chi2 - best.chi2
    return Finalist(best, delta_chi2, minus_log_p_of(delta_chi2, best.sizes()[-1]))


def _from_before(search: Search, model: Model, begun: Model) -> Model:
    """Where an earlier fit of the same effects ended, on other rows or at another floor, if that explains anything here."""
    values = best_known(begun, search.predictor)
    if values is None:
        return begun
    try:
        residual = search.problem.residual(search.predictor(begun.terms(values)))
    except StiffmapError:
        return begun
    return replace(begun, values=values) if float(residual @ residual) < model.chi2 else begun


def _near(screen: Screen, model: Model, i: int) -> Floats | None:
    """(N, k) Jacobian of the model and one effect more, the effect's at its null; None where it has no slope there."""
    variant, columns = screen.variants[i], screen.columns(i)
    shaped = (
        variant.shape or variant.start is not None or columns.shape[1] < len(variant.candidate.parameters)
    )
    if shaped or not np.any(columns != 0.0, axis=0).all():
        return None
    own = model.jacobian if model.jacobian is not None else np.zeros((screen.readings, 0))
    return np.column_stack([own, -columns])


def minus_log_p_of(delta_chi2: float, freedom: int) -> float:
    """-ln p of such a reduction of chi-square."""
    if not np.isfinite(delta_chi2):
        return 0.0
    return float(chi2_minus_log_p(np.array(max(delta_chi2, 0.0)), np.array(freedom, dtype=np.intp)))


def start_values(variant: Variant, estimate: Floats, flat: NDArray[np.bool_]) -> list[Floats]:
    """Values of all parameters (in scales) to start fits from: null plus the linear estimate.

    `flat` (p,) are parameters that are not observable at the null; with large values of the
    others they may, to second order, and to either side.
    """
    c = variant.candidate
    if variant.start is not None:
        given = {**variant.start(estimate), **dict(variant.shape)}
        return [np.array([given[p.name] / p.scale for p in c.parameters])]
    if variant.shape:
        return [shaped(variant, estimate)]
    null = np.array([float(p.null or 0.0) / p.scale for p in c.parameters])
    size = float(np.abs(estimate).max(initial=0.0))
    aside = [sign * 0.3 * size * flat for sign in (1.0, -1.0)] if flat.any() and size > LARGE else []
    return [null + estimate, *(null + estimate + a for a in aside)]


def shaped(variant: Variant, estimate: Floats) -> Floats:
    """Linear parameters at null plus estimate, the others as the variant has them (in scales)."""
    given = dict(variant.shape)
    given |= {
        p.name: float(p.null or 0.0) + float(v) * p.scale
        for p, v in zip(variant.candidate.linear, estimate, strict=True)
    }
    return np.array([given[p.name] / p.scale for p in variant.candidate.parameters])


def backward(search: Search, model: Model) -> Model:
    """Drop effects that the others make unnecessary, the least necessary first."""
    while len(model.candidates) > 1:
        trials = [
            fit_without(model, i, search.predictor, search.problem) for i in range(len(model.candidates))
        ]
        sizes = model.sizes()
        minus_log_p = [
            minus_log_p_of(t.chi2 - model.chi2, n) if t.usable else np.inf
            for t, n in zip(trials, sizes, strict=True)
        ]
        worst = int(np.argmin(minus_log_p))
        if minus_log_p[worst] > search.threshold:
            return model
        model = trials[worst]
    return model


def exchange(search: Search, model: Model) -> Model:
    """Replace single effects by others while that explains clearly more."""
    for _ in range(3 if len(model.candidates) > 1 else 0):
        better = model
        for i in range(len(model.candidates)):
            if search.clock.over:
                return model
            if search.clock.tired:
                search.clock.leave_out(f"others in place of {model.candidates[i]}")
                continue
            reduced = fit_without(model, i, search.predictor, search.problem)
            if not reduced.usable:
                continue
            now = minus_log_p_of(reduced.chi2 - model.chi2, model.sizes()[i])
            found = best_addition(search, reduced, model.candidates[i], now)
            if found and score(found.model, search.problem) > score(better, search.problem) + 1.0:
                better = found.model
        if better is model:
            return model
        model = better
    return model


def score(model: Model, problem: Problem) -> float:
    """Log-likelihood less Schwarz's penalty for the number of parameters."""
    return -0.5 * model.chi2 - 0.5 * model.freedom * float(np.log(max(len(problem), 2)))
