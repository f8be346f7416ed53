"""Several effects of one kind at one place, such as two periods of one drive.

A search has each place once: the effect there, at a shape of the grid, leaves so much that the next best shape would often be next
to its own. Once the shapes are refined, what is left may ask for another shape.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain, count

import numpy as np

from stiffmap.identification.candidates.candidates import clash
from stiffmap.identification.inference.amplitudes import fitted
from stiffmap.identification.inference.chosen import Chosen, evidence
from stiffmap.identification.inference.constants import MOST_EFFECTS, ODDS
from stiffmap.identification.inference.parts import log_mean
from stiffmap.identification.inference.places import Shape
from stiffmap.identification.inference.world import PROGRESS, SHORT, Model, World, amplitudes, largest_gain

APART = 0.5
"""Mean squared cosine between the directions of two shapes, below which they are two effects."""
MOST = 2
"""Shapes at one place: a gear has two periods, while enough waves make any curve."""


def with_more_shapes(world: World, model: Model) -> Model:
    """The model without effects that only stood for what the grid misses, and with further ones at places that it has already, alone or
    in the stead of one at another place; the same where that is no better."""
    while not world.over():
        better = next(_better(world, model), None)
        if better is None:
            break
        model = better
    return model


def _better(world: World, model: Model) -> Iterator[Model]:
    """Models to go on with, the simplest first."""
    odds = float(np.log(ODDS))
    limit = model.score + odds + world.price
    if not any(c.shaped for c in model.chosen):
        return
    fewer = [world.refined(world.less(model, c)) for c in model.chosen if len(model.chosen) > 1]
    # between the points of the grid an effect may not be needed
    yield from (m for m in fewer if m.score > model.score - odds)
    if len(model.chosen) < MOST_EFFECTS:
        yield from (m for m in _further(world, model, limit) if m.score > limit)
    for c, less in zip(model.chosen, fewer, strict=False):
        if (
            sum(o.place is c.place for o in model.chosen) == 1
        ):  # else one shape would count for the other, too
            yield from (m for m in _further(world, less, model.score) if m.score > model.score + PROGRESS)


def _further(world: World, model: Model, beat: float) -> Iterator[Model]:
    """The model with the best further shape at each of its places, as far as that comes near the evidence to `beat`."""
    fit = model.fit
    for place in {id(c.place): c.place for c in model.chosen if c.shaped}.values():
        own = [c for c in model.chosen if c.place is place]
        if clash(place.candidate, [place.candidate]) or len(own) >= MOST:
            continue
        apart = [all(_apart(s, place.shapes[c.shape]) for c in own) for s in place.shapes]
        gain = np.where(apart, evidence(fit, (place,))[0], -np.inf)
        if model.score + gain.max() < beat - SHORT:
            continue
        k = int(np.argmax(gain))
        bare = Chosen.at(place, k)
        part = replace(bare.part, name=_free(str(place.candidate), [c.part.name for c in own]))
        start = amplitudes(fit) | {part.name: largest_gain(fit, part)}
        more = fitted(fit.columns, (*fit.parts, part), start, fit.weights, fit.lighter)
        score = model.score + more.score - fit.score + float(log_mean(gain)) - float(gain[k])
        added = replace(bare, part=part).by_posterior(more)
        if added.is_possible:
            yield world.refined(replace(model, chosen=(*model.chosen, added), fit=more, score=score))


def _free(name: str, taken: Sequence[str]) -> str:
    """The name, or with the first number that no other effect at that place has."""
    numbered = chain([name], (f"{name}, {k}" for k in count(2)))
    return next(n for n in numbered if n not in taken)


def _apart(one: Shape, other: Shape) -> bool:
    rank = min(one.directions.shape[1], other.directions.shape[1])
    return bool(np.sum((one.directions.T @ other.directions) ** 2) < APART * rank)
