"""Two effects of one kind at one place, such as two periods of one drive.

A search has each place once: the effect there, at a shape of the grid, leaves so much that the next best shape would often be next
to its own. Once the shapes are refined, what is left may ask for another shape; for no third one, since enough waves make any curve.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from stiffmap.identification.candidates.candidates import clash
from stiffmap.identification.inference.amplitudes import fitted
from stiffmap.identification.inference.chosen import Chosen, evidence
from stiffmap.identification.inference.constants import MOST_EFFECTS, ODDS
from stiffmap.identification.inference.parts import log_mean
from stiffmap.identification.inference.places import Place, Shape
from stiffmap.identification.inference.world import PROGRESS, SHORT, Model, World, largest_gain

APART = 0.5
"""Mean squared cosine between the directions of two shapes, below which they are two effects."""


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
        if len(_at(model, c.place)) == 1:  # else one shape would count for the other, too
            yield from (m for m in _further(world, less, model.score) if m.score > model.score + PROGRESS)


def _further(world: World, model: Model, beat: float) -> Iterator[Model]:
    """The model with the best further shape at each of its places, as far as that comes near the evidence to `beat`."""
    fit = model.fit
    for place in {id(c.place): c.place for c in model.chosen if c.shaped}.values():
        own, *second = _at(model, place)
        if second or clash(place.candidate, [place.candidate]):
            continue
        apart = [_apart(s, place.shapes[own.shape]) for s in place.shapes]
        gain = np.where(apart, evidence(fit, (place,))[0], -np.inf)
        if model.score + gain.max() < beat - SHORT:
            continue
        k = int(np.argmax(gain))
        bare = Chosen.at(place, k)
        if own.part.name == bare.part.name:
            bare = replace(bare, part=replace(bare.part, name=f"{bare.part.name}, 2"))
        start = fit.amplitudes | {bare.part.name: largest_gain(fit, bare.part)}
        more = fitted(fit.columns, (*fit.parts, bare.part), start, fit.weights, fit.lighter)
        score = model.score + more.score - fit.score + float(log_mean(gain)) - float(gain[k])
        added = bare.by_posterior(more)
        if added.is_possible:
            yield world.refined(replace(model, chosen=(*model.chosen, added), fit=more, score=score))


def _at(model: Model, place: Place) -> list[Chosen]:
    return [c for c in model.chosen if c.place is place]


def _apart(one: Shape, other: Shape) -> bool:
    rank = min(one.directions.shape[1], other.directions.shape[1])
    return bool(np.sum((one.directions.T @ other.directions) ** 2) < APART * rank)
