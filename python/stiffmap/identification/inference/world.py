"""The search over sets of effects in one world: forward steps, each with elimination, exchange and pairs after it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
from scipy.optimize import least_squares

from stiffmap.experiment.experiment import Floats
from stiffmap.identification.candidates.candidates import clash
from stiffmap.identification.inference.amplitudes import QUIET, Fit, fitted, refitted
from stiffmap.identification.inference.chosen import Chosen, all_moved, evidence, of_pairs
from stiffmap.identification.inference.columns import Columns
from stiffmap.identification.inference.constants import MOST_EFFECTS, ODDS, REFITS, SIZES
from stiffmap.identification.inference.parts import Part, gains, log_mean, spectrum
from stiffmap.identification.inference.places import Place

EXACT = "exact"
SETTLED = 0.3
"""Noise: a correction that changes less is none."""
PROGRESS = 0.1
"""Gain of evidence, ln, below which one set is not better than another."""
CORRECTIONS = 3
"""Gauss-Newton corrections of the residual by whole predictions with the effects of a model."""
SINGLES = 24
"""Best single places of which pairs are tried; effort only."""
SHORT = 10.0
"""Evidence, ln, by which a bound may fall short of the fit: what is further below is not fitted; effort only."""
RIVALS_FITTED = 4
"""Places in an effect's stead that are fitted; effort only."""
SAME_EVIDENCE = 2.0
"""Evidence, ln, within which the coarsest part has the name."""
AT_MOST, ENOUGH, FAR = 25, 1e-4, 1e6
"""Steps to the optimum of effects that bend, and the share of the squares whose gain ends them, effort only; the misfit of a machine
that fails."""
Shapes = tuple[tuple[int, int, tuple[tuple[str, float], ...]], ...]
"""Of a set of effects: each with its place's `id`, its shape on the grid, and where that was refined."""
Bound = tuple[float, Place, Fit]
"""Evidence with a place, from below, and the amplitudes that give it."""
Predict = Callable[[Sequence[Chosen]], Floats]
"""(m,) what effects of given strengths add to the readings, by the machine itself; NaN where it fails."""


@dataclass(frozen=True, eq=False)
class Model:
    """A set of effects in one world, at its best amplitudes."""

    world: str
    """``exact``, ``together`` or ``groups``."""
    chosen: tuple[Chosen, ...]
    fit: Fit
    score: float
    """Evidence of the set: that of the fit, mean over shapes."""


@dataclass(eq=False)
class World:
    """The search in one world."""

    columns: Columns
    gaps: tuple[Part, ...]
    name: str
    numbers: tuple[Part, ...]
    predict: Predict | None
    over: Callable[[], bool]
    optima: dict[Shapes, Floats]
    known: dict[frozenset[tuple[int, int]], Model] = field(default_factory=dict)
    anchors: dict[int, tuple[Model, list[Fit]]] = field(default_factory=dict)

    @property
    def price(self) -> float:
        """ln of the places that an effect may be at."""
        return float(np.log(max(1, len(self.columns.places))))

    @property
    def null(self) -> Model:
        """No effect at all."""
        return self._fit((), None)

    def search(self, begin: Model) -> Model:
        """The best set: forward steps with elimination and exchange after each, from the effects of the best model of other worlds; it ends where
        it would fall short of that even if each effect that may follow, and their exchanges, gained as much as the last one."""
        model = null = self.null
        if begin.chosen:
            same = self._fit(begin.chosen, begin.fit.amplitudes, begin.fit.weights)
            model = max(null, self._settled(same), key=lambda m: m.score)
        limit = float(np.log(ODDS)) + self.price
        while len(model.chosen) < MOST_EFFECTS and not self.over():
            trials = self._trials(model)
            if not trials:
                break
            best, all_gains = trials
            total = float(np.logaddexp.reduce(all_gains))
            if total <= limit:
                break  # the odds of all places together
            to_come = 1 + MOST_EFFECTS - len(best.chosen)
            if begin.world != self.name and best.score + to_come * (best.score - model.score) < begin.score:
                break
            better = self._settled(best)
            if len(better.chosen) <= len(model.chosen) and better.score <= model.score + PROGRESS:
                break
            model = better
        return self.refined(model)

    def _trials(self, model: Model, beat: float = -np.inf) -> tuple[Model, Floats] | None:
        """The model with the best further effect, and the gain of each place; None where none comes near the evidence to `beat`."""
        found = self._bounds(model) if np.isfinite(model.score) else []
        if not found:
            return None
        order = sorted(found, key=lambda b: -b[0])
        likely = [b for b in order[:REFITS] if b[0] >= beat - SHORT]
        if not likely:
            return None
        refits = [self._with(model, [place], anchor) for _, place, anchor in likely]
        scores = {id(p): s for s, p, _ in order}
        for m, (_, place, _) in zip(refits, likely, strict=True):
            key = id(place)
            scores[key] = max(scores[key], m.score) if np.isfinite(m.score) else -np.inf
        best = max(refits, key=lambda m: m.score)
        return (best, np.array(list(scores.values())) - model.score) if np.isfinite(best.score) else None

    def _bounds(self, model: Model, more: tuple[Fit, ...] = ()) -> list[Bound]:
        """Per place a lower bound of the evidence with it, and the anchor that gives it; `more` anchors than its own."""
        taken = {id(c.place) for c in model.chosen}
        others = [c.place.candidate for c in model.chosen]
        free = tuple(p for p in self.columns.places if id(p) not in taken and not clash(p.candidate, others))
        if not free:
            return []
        extra, anchors = model.score - model.fit.score, (*self._anchors(model), *more)
        found = [[log_mean(g) + a.score + extra for g in evidence(a, free)] for a in anchors]
        out = []
        for k, place in enumerate(free):
            which = int(np.argmax([f[k] for f in found]))
            out.append((float(found[which][k]), place, anchors[which]))
        return out

    def _anchors(self, model: Model) -> list[Fit]:
        """Amplitudes at which candidates are judged: as fitted; without gaps; the same at the declared noise."""
        fit = model.fit
        if id(model) in self.anchors:
            return self.anchors[id(model)][1]
        gaps, found = [g.name for g in self.gaps], [fit]
        if any(p.name in gaps for p, _ in fit.on):
            effects = tuple(c.part for c in model.chosen)
            found.append(fitted(fit.columns, (*self.numbers, *effects), fit.amplitudes, fit.weights))
        found.append(found[-1].without(gaps, noise=1.0))
        self.anchors[id(model)] = model, found
        return found

    def _with(self, model: Model, places: Sequence[Place], anchor: Fit) -> Model:
        """The model with further effects, fitted from the anchor."""
        chosen = list(model.chosen)
        start = {**{g.name: QUIET for g in self.gaps}, **anchor.amplitudes}
        for place in places:
            chosen.append(Chosen.at(place, best_shape(anchor, place)))
            start[chosen[-1].part.name] = largest_gain(anchor, chosen[-1].part)
        return self._fit(tuple(chosen), start, anchor.weights, model.fit.lighter)

    def _fit(
        self,
        chosen: tuple[Chosen, ...],
        start: dict[str, float] | None,
        weights: Floats | None = None,
        lighter: float = 0.0,
    ) -> Model:
        """A set at its best amplitudes, on a residual that is corrected for what the effects' columns miss; fitted once."""
        key = frozenset((id(c.place), c.shape) for c in chosen)
        if key in self.known:
            return self.known[key]
        chosen = tuple(replace(c, values=np.zeros(0), refined=()) for c in chosen)
        parts = (*self.numbers, *self.gaps, *(c.part for c in chosen))
        fit = fitted(self.columns, parts, start, weights, lighter)
        found: tuple[Fit, tuple[Chosen, ...]] | None = fit, chosen
        if any(c.by_posterior(fit).is_too_large for c in chosen):
            found = None
        elif self.predict and chosen:
            found = self._corrected(fit, chosen)
        if found is None:
            return self.known.setdefault(key, Model(self.name, chosen, fit, -np.inf))
        fit, chosen = found
        chosen = tuple(c if len(c.values) else c.by_posterior(fit) for c in chosen)
        shapes = 0.0
        for c in chosen:
            if len(c.place.shapes) > 1:
                each = evidence(fit.without([c.part.name]), (c.place,))[0]
                shapes += float(log_mean(each) - each[c.shape])
        possible = all(c.is_possible for c in chosen)
        self.known[key] = Model(self.name, chosen, fit, fit.score + shapes if possible else -np.inf)
        return self.known[key]

    def _corrected(self, fit: Fit, chosen: tuple[Chosen, ...]) -> tuple[Fit, tuple[Chosen, ...]] | None:
        """The fit on a residual less what straight lines miss of the effects; where that does not settle, at their own optimum,
        with their values there; None where the machine cannot have them."""
        assert self.predict
        now, shown = fit, None
        for _ in range(CORRECTIONS + 1):
            at = tuple(c.by_posterior(now) for c in chosen)
            line = np.sum([c.rotated(self.columns) @ c.values for c in at], axis=0)
            if shown is not None and _near(line, shown):
                return now, chosen
            missed = self.predict(at) - line
            if not np.isfinite(missed).all():
                break
            if shown is None and _gain(fit, missed) < PROGRESS:
                return fit, chosen
            shown = line
            now = refitted(now, self.columns.residual - missed)
        found = self._at_optimum(fit, chosen)
        return found if found is None or all(len(c.strengths) for c in found[1]) else (fit, chosen)

    def _at_optimum(self, fit: Fit, chosen: tuple[Chosen, ...]) -> tuple[Fit, tuple[Chosen, ...]] | None:
        """The fit on a residual less what the effects' columns miss at their own optimum, and the effects there; None where the
        machine fails."""
        assert self.predict
        at = self._optimum(fit, chosen)
        shown = self.predict(at)
        if not np.isfinite(shown).all():
            return None
        lines = np.hstack([c.rotated(self.columns) for c in at])
        missed = shown - lines @ np.linalg.lstsq(lines, shown, rcond=1e-9)[0]
        return refitted(fit, self.columns.residual - missed), at

    def refined(self, model: Model) -> Model:
        """The set with its shapes (periods, knees) where they fit best, between those of the grid; the same where that is no better. What
        nobody can name has taken what the grid misses, so that each optimum is one under the amplitudes of the last one."""
        for _ in range(CORRECTIONS):
            if not self.predict or not any(c.shaped for c in model.chosen) or self.over():
                return model
            found = self._at_optimum(model.fit, model.chosen)
            if not found:
                return model
            fit, at = found
            gain = fit.score - model.fit.score
            if gain <= PROGRESS or not all(c.is_possible for c in at):
                return model
            model = replace(model, chosen=at, fit=fit, score=model.score + gain)
        return model

    def _optimum(self, fit: Fit, chosen: tuple[Chosen, ...]) -> tuple[Chosen, ...]:
        """The effects at the least squares of whole predictions, all else of the fit as it is; found once for each set."""
        assert self.predict
        predict, key = self.predict, tuple((id(c.place), c.shape, c.refined) for c in chosen)
        if key not in self.optima:
            rest = fit.without([c.part.name for c in chosen])
            begin = np.concatenate([c.whole if c.refined else c.by_posterior(fit).whole for c in chosen])
            low, high = (np.concatenate([c.limits[k] for c in chosen]) for k in (0, 1))
            inside = 1e-6 * np.minimum(np.nan_to_num(high - low, posinf=1.0), 1.0)

            def residual(x: Floats) -> Floats:
                left = rest.white(self.columns.residual - predict(all_moved(chosen, x)))
                return np.where(np.isfinite(left), left, FAR)

            begin = np.clip(begin, low + inside, high - inside)
            how = {"x_scale": "jac", "diff_step": 1e-3, "ftol": ENOUGH, "max_nfev": AT_MOST}
            self.optima[key] = least_squares(residual, begin, "2-point", (low, high), **how).x
        return all_moved(chosen, self.optima[key])

    def _settled(self, model: Model) -> Model:
        """The model after exchanges, one by one and by pairs."""
        return self._exchanged(self._by_pairs(self._exchanged(model)))

    def _exchanged(self, model: Model) -> Model:
        """Each effect in turn left out where that costs less than odds, or given up for a better one."""
        for _ in range(2):
            before = model
            for c in model.chosen if len(model.chosen) > 1 else ():
                fewer = self.less(model, c)
                if model.score - fewer.score < float(np.log(ODDS)):
                    model = fewer
                    break
                found = self._trials(fewer, model.score)
                if found and found[0].score > model.score + PROGRESS:
                    model = found[0]
                    break
            if model is before:
                return model
        return model

    def _by_pairs(self, model: Model) -> Model:
        """Two effects at once given up for two others: one after the other they may never change."""
        for first, second in combinations(model.chosen, 2):
            fewer = self.less(self.less(model, first), second)
            bounds = sorted(self._bounds(fewer), key=lambda b: -b[0])[:SINGLES]
            if len(bounds) < 2:
                continue
            for anchor in self._anchors(fewer):
                shapes = [p.shapes[best_shape(anchor, p)] for _, p, _ in bounds]
                gain = np.tril(of_pairs(anchor, shapes), -1)
                short = model.fit.score - anchor.score - gain
                for k in np.argsort(gain, axis=None)[::-1][:REFITS]:
                    places = [bounds[int(i)][1] for i in np.unravel_index(int(k), gain.shape)]
                    if clash(places[0].candidate, [places[1].candidate]):
                        continue
                    if self.name != EXACT and short.flat[k] > SHORT:
                        continue  # in "exact" nothing takes up what a set lacks, and bounds lie far too low
                    pair = self._with(fewer, places, anchor)
                    if pair.score > model.score + PROGRESS:
                        return pair
        return model

    def less(self, model: Model, c: Chosen) -> Model:
        """The effects of a model but one, in this world."""
        kept = tuple(o for o in model.chosen if o.part.name != c.part.name)
        return self._fit(kept, model.fit.amplitudes, model.fit.weights, model.fit.lighter)

    def without(self, model: Model, gone: Chosen, heir: Sequence[Place]) -> Model:
        """The model without an effect, or with another place in its stead, at its best shapes."""
        fewer = self.less(model, gone)
        return self.refined(self._with(fewer, heir, fewer.fit) if heir else fewer)

    def coarsest(self, model: Model) -> Model:
        """The set with the coarsest part in each effect's place, of those whose evidence is the same."""
        order = {id(p): k for k, p in enumerate(self.columns.places)}
        for c in model.chosen:
            fitted = self._fitted(model, c, self._steads(model, c))
            found = [(order[id(p)], m) for p, m in fitted if m.score > model.score - SAME_EVIDENCE]
            first = min(found, key=lambda f: f[0], default=None)
            if first is not None and first[0] < order[id(c.place)]:
                model = first[1]
        return model

    def _steads(self, model: Model, c: Chosen) -> list[Bound]:
        """Bounds of all places in an effect's stead, the likeliest first."""
        at_best = model.fit.without([c.part.name])
        return sorted(self._bounds(self.less(model, c), (at_best,)), key=lambda b: -b[0])

    def _fitted(self, model: Model, c: Chosen, steads: list[Bound]) -> list[tuple[Place, Model]]:
        """The likeliest places in an effect's stead, fitted."""
        less = self.less(model, c)
        likely = [b for b in steads if b[1] is not c.place and b[0] > model.score - SHORT]
        return [(p, self._with(less, [p], anchor)) for _, p, anchor in likely[:RIVALS_FITTED]]

    def rivals(self, model: Model) -> tuple[tuple[float, tuple[tuple[Place, float], ...]], ...]:
        """Per effect its ln odds, all places that would do together, and those places; the likeliest are fitted."""
        out = []
        for c in model.chosen:
            less, steads = self.less(model, c), self._steads(model, c)
            scores = {id(p): (s - model.score, p) for s, p, _ in steads}
            for p, m in self._fitted(model, c, steads):
                scores[id(p)] = (max(scores[id(p)][0], m.score - model.score), p)
            scores[id(c.place)] = (0.0, c.place)
            together = float(np.logaddexp.reduce([s for s, _ in scores.values()]))
            odds = model.score + together - less.score - self.price
            near = [(p, s) for s, p in scores.values() if p is not c.place and s > -np.log(ODDS)]
            out.append((odds, tuple(sorted(near, key=lambda n: -n[1]))))
        return tuple(out)


def _gain(fit: Fit, missed: Floats) -> float:
    """Change of the evidence, at most, where the residual is less by something (m,), all amplitudes as they are."""
    white = fit.white(missed)
    return abs(float(missed @ fit.solved)) + 0.5 * float(white @ white)


def _near(one: Floats, other: Floats) -> bool:
    """Whether two changes of the readings are the same within a tenth, or within the noise."""
    return float(np.linalg.norm(one - other)) < max(SETTLED, 0.1 * float(np.linalg.norm(one)))


def best_shape(anchor: Fit, place: Place) -> int:
    """Number of the shape that gains most at the anchor's amplitudes."""
    return int(np.argmax(evidence(anchor, (place,))[0]))


def largest_gain(anchor: Fit, part: Part) -> float:
    """ln variance of an effect that gains most at the anchor's amplitudes."""
    assert part.factor is not None
    best = int(np.argmax(gains(*spectrum(anchor.root, anchor.solved, part.factor))))
    return float(2.0 * np.log(SIZES[best]))
