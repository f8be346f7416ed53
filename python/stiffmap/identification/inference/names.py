"""From readings to a set of names: columns, then a search over sets of effects by evidence, in three worlds.

In the world "exact" declared numbers are as declared but for the effects; in "together" all are off by the same share of
their uncertainties, in "groups" each group by its own. All are searched alike and as likely before any reading.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stiffmap.common.broadcasting import Mask
from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.noise.level import Noise
from stiffmap.experiment.noise.outliers import without_suspects
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.candidates.sensitivity import CandidatePlan
from stiffmap.identification.clock import Clock
from stiffmap.identification.inference.amplitudes import Fit, evaluated, fitted
from stiffmap.identification.inference.chosen import Chosen
from stiffmap.identification.inference.columns import Columns, columns
from stiffmap.identification.inference.constants import ODDS
from stiffmap.identification.inference.parts import Part, Parts
from stiffmap.identification.inference.places import Place
from stiffmap.identification.inference.several import with_more_shapes
from stiffmap.identification.inference.world import (
    EXACT,
    PROGRESS,
    Model,
    Predict,
    Shapes,
    World,
    best_shape,
    largest_gain,
)
from stiffmap.identification.numbers.certificate import Tolerances
from stiffmap.identification.numbers.unknowns import SAG, Unknown, uncertain
from stiffmap.model import effects

BEHIND = 30.0
"""Evidence, ln, by which a world may fall short of the best one for its effects to get further shapes; effort only."""


@dataclass(frozen=True, eq=False)
class Search:
    """What one search over sets of effects found."""

    best: Model
    null: Model
    gain: tuple[float, ...]
    """ln odds of each named effect against none, all places together, in the order of `best.chosen`."""
    equivalents: tuple[tuple[tuple[Place, float], ...], ...]
    """Per named effect, the places that would do in its stead, with their evidence less that of the best."""
    instead: tuple[tuple[Model, float] | None, ...] = ()
    """Per named effect, the best model of another world in which it is not, and its ln odds against that."""
    exact: float = -np.inf
    """Evidence without any effect where all declared numbers are as declared."""
    calibrated: Fit | None = None
    """The best fit without effects in a world where declared numbers are off; None where there are none."""

    world: World | None = None
    """Where the best model was found."""

    def less(self, gone: Chosen, *heir: Place) -> Search:
        """Without one of its effects, all else fitted anew; `heir`: the first of its equivalents, which takes its place."""
        number = {c.part.name: i for i, c in enumerate(self.best.chosen)}
        # a number out of tolerance may have the name of an effect
        if self.world is None or gone.part.name not in number:
            return self
        k = number[gone.part.name]
        best = self.world.without(self.best, gone, heir)
        order = [number.get(c.part.name, k) for c in best.chosen]
        near = [*self.equivalents[:k], self.equivalents[k][1:], *self.equivalents[k + 1 :]]
        return replace(
            self,
            best=best,
            gain=tuple(self.gain[i] for i in order),
            equivalents=tuple(near[i] for i in order),
            instead=tuple(self.instead[i] for i in order),
        )


def searched(
    columns: Columns,
    predict: Predict | None = None,
    over: Callable[[], bool] = lambda: False,
    *,
    travel: bool = False,
) -> Search:
    """The best set of effects over all worlds; no step begins once time is `over`. `travel`: whether drives may err along their
    travel in any smooth way. Heavy tails are those of readings, or of rows where these are likelier."""
    searches = _worlds(columns, predict, over, travel)
    if tied := columns.of_rows:
        of_rows = _worlds(tied, predict, over, travel)
        middle = searches[:2][-1], of_rows[:2][-1]  # numbers off together, where there are any
        if middle[1].null.score > middle[0].null.score + PROGRESS:
            searches = of_rows
    searches.sort(key=lambda w: -w.null.score)
    found: dict[str, Model] = {}
    for w in searches:
        begin = max(found.values(), key=lambda m: m.score, default=w.null)
        found[w.name] = m = w.search(begin)
        if m.score > begin.score - BEHIND:
            found[w.name] = with_more_shapes(w, m)
    best = _with_rivals(max(found.values(), key=lambda m: m.score), searches, found)
    likelier = [m for m, odds in filter(None, best.instead) if odds < 0.0]
    if likelier:  # without an effect, which may be at any place, in another world
        best = _with_rivals(max(likelier, key=lambda m: m.score), searches, found)
    exact = next(w.null for w in searches if w.name == EXACT)
    off = [w.null.fit for w in searches if w.name != EXACT]
    return replace(best, exact=exact.score, calibrated=max(off, key=lambda f: f.score, default=None))


def _worlds(columns: Columns, predict: Predict | None, over: Callable[[], bool], travel: bool) -> list[World]:
    """Exact, together and groups, as far as there are numbers and time."""
    parts = Parts(columns)
    gaps = (*parts.gaps, *parts.travel) if travel else parts.gaps
    worlds: dict[str, tuple[Part, ...]] = {EXACT: ()}
    if columns.unknowns and not over():
        worlds |= {"together": parts.together, "groups": parts.numbers}
    optima: dict[Shapes, Floats] = {}
    return [World(columns, gaps, name, own, predict, over, optima) for name, own in worlds.items()]


def _with_rivals(model: Model, searches: Sequence[World], found: Mapping[str, Model]) -> Search:
    """A model with what would do in the stead of each of its effects, in its own world and in others."""
    own = next(w for w in searches if w.name == model.world)
    others = [w for w in searches if w is not own]
    model = own.coarsest(model)
    rivals = own.rivals(model)
    near = tuple(places for _, places in rivals)
    each = zip(model.chosen, near, strict=True)
    instead = tuple(_without(c, places, model, own.price, others, found) for c, places in each)
    return Search(model, own.null, tuple(odds for odds, _ in rivals), near, instead, world=own)


def with_travel(fit: Fit, *, anew: bool) -> Fit:
    """The fit where drives may also err along their travel in any smooth way; the same fit if that is no likelier. `anew`: not from its
    amplitudes, since what took the place of travel there may keep it; heavy tails as in `searched`."""
    parts = (*fit.parts, *(more := Parts(fit.columns).travel))
    if not more:
        return fit
    if not anew:
        return max(fit, fitted(fit.columns, parts, fit.amplitudes, fit.weights), key=lambda f: f.score)
    found = [fitted(c, parts) for c in (fit.columns, fit.columns.of_rows) if c]
    return max([fit, *found], key=lambda f: f.score)


def _where_it_sags(columns: Columns) -> Columns:
    """The columns; without the sag of drives unless that is worth the odds of a name: every arm sags, and few so that it shows."""
    if SAG not in columns.groups:
        return columns
    rigid = columns.without(SAG)
    worlds, bare = (_worlds(c, None, lambda: False, False) for c in (columns, rigid))
    more, less = (max(w.null.score for w in each) for each in (worlds, bare))
    return columns if more - less > np.log(ODDS) + worlds[0].price else rigid


def of_noise_alone(columns: Columns) -> Fit | None:
    """The best fit of the numbers that set-ups share, with noise and nothing else; None where there are none."""
    parts, groups = Parts(columns), columns.groups
    of_setups = [name for name, index in groups.items() if columns.unknowns[index[0]].setup]
    shared = ([p for p in some if p.name not in of_setups] for some in (parts.together, parts.numbers))
    found = [fitted(columns, some) for some in shared if some]
    return max(found, key=lambda f: f.score, default=None)


def put_instead(fit: Fit, c: Chosen, place: Place) -> Chosen:
    """Another place in the stead of an effect of a fit, nothing else fitted anew."""
    anchor = fit.without([c.part.name])
    bare = Chosen.at(place, best_shape(anchor, place))
    t = np.append(anchor.t, largest_gain(anchor, bare.part))
    found = evaluated(anchor.columns, (*anchor.parts, bare.part), t, anchor.weights)
    return bare.by_posterior(found)


def _without(
    c: Chosen,
    near: Sequence[tuple[Place, float]],
    model: Model,
    price: float,
    others: Sequence[World],
    found: Mapping[str, Model],
) -> tuple[Model, float] | None:
    """The best model of another world in which an effect, and what would do in its stead, is not; and the ln odds against that of the
    effect and of what would do in its stead, each effect more at the `price` of its places."""
    same = {id(c.place), *(id(p) for p, _ in near)}
    models = [m for w in others for m in (w.less(model, c), w.null, found[w.name])]
    allowed = (m for m in models if not same & {id(o.place) for o in m.chosen})
    other = max(allowed, key=lambda m: m.score - price * len(m.chosen), default=None)
    if other is None:
        return None
    together = model.score + float(np.logaddexp.reduce([0.0, *(s for _, s in near)]))
    return other, together - other.score - price * (len(model.chosen) - len(other.chosen))


@dataclass(frozen=True, eq=False)
class Inferred:
    """What a search had, and what it found."""

    plan: CandidatePlan
    noise: Noise
    suspects: Mask
    """(n,) rows that stand alone before any cause is known."""
    uncertain: tuple[Unknown, ...]
    """All declared numbers that have an uncertainty."""
    columns: Columns
    search: Search


def infer(
    predictor: Predictor,
    plan: CandidatePlan,
    tolerances: Tolerances | None = None,
    exclude: Sequence[str] = (),
    clock: Clock | None = None,
    seed: int = 0,
    *,
    travel: bool = False,
) -> Inferred:
    """The set of effects with the best evidence; `exclude`: kinds of effects and groups of numbers that are known not to be;
    `travel`: whether drives may err along their travel in any smooth way."""
    e, clock = predictor.experiment, clock or Clock()
    noise, suspects = without_suspects(e, plan.base)
    plan = replace(plan, variants=tuple(v for v in plan.variants if v.candidate.kind not in exclude))
    numbers = uncertain(predictor.machine.description, e, tolerances, exclude)
    clock.say("columns of the declared numbers")
    found = _where_it_sags(columns(predictor, plan, noise.sigma, numbers, seed))

    used = np.isin(np.arange(len(e)), found.rows)
    drawn = predictor if used.all() else predictor.beside(rows=used)
    at = (np.cumsum(used) - 1)[found.rows], found.channel
    before = plan.base[found.rows, found.channel]

    def predict(chosen: Sequence[Chosen]) -> Floats:
        added = [c.term for c in chosen]
        whole = any(effects.get(t.kind).drive for t in added)  # what drives remember is of the rows before
        try:
            shown = predictor(added)[used] if whole else drawn(added)
        except StiffmapError:  # too large for the machine
            return np.full(len(found), np.nan)
        return found.rotated(shown[at] - before)

    clock.say("all effects at once")
    search = searched(found, predict, lambda: clock.over, travel=travel)
    return Inferred(plan, noise, suspects, numbers, found, search)
