"""Which explanation leads, which mean the same to this plan, and which remain as rivals."""

from __future__ import annotations

from dataclasses import dataclass

from stiffmap.identification.diagnosis.candidates.candidates import Candidate
from stiffmap.identification.diagnosis.fitting.model import Model
from stiffmap.identification.diagnosis.rivals.rivals import Rival, rivals, two_words
from stiffmap.identification.diagnosis.search.alias import coarseness
from stiffmap.identification.diagnosis.search.selection import Search, score
from stiffmap.identification.diagnosis.search.study import Study
from stiffmap.model.effects import registry

EQUAL = 2.0
"""Difference of scores (ln) within which explanations count as equally good."""


@dataclass(frozen=True, eq=False)
class Explanation:
    """The model that the verdict names, and what else the readings allow."""

    model: Model
    aliases: tuple[tuple[Candidate, Candidate, Model], ...] = ()
    """Effect of the model, its alias at the size found, and the model with the alias in its place."""
    others: tuple[Model, ...] = ()
    """Rivals that another plan, or luck, would have distinguished."""


def explain(s: Study, search: Search, model: Model) -> Explanation:
    """The explanation that leads, its aliases at this size, and the rivals that stay.

    Of those that the readings find equally good the coarsest physical part leads, by the rule of
    representatives: two definitions of one error by the order of the kinds, the whole before its part.
    """
    found = rivals(search, model, s.classes)
    first = _leader(s, search, model, found)
    if first is None:
        same = tuple((model.candidates[r.replaces], r.candidate, r.model) for r in found if r.same)
        return Explanation(model, same, tuple(r.model for r in found if not r.same))
    swapped = ((first.candidate, model.candidates[first.replaces], model),) if first.same else ()
    same = tuple(
        (
            first.candidate if r.replaces == first.replaces else model.candidates[r.replaces],
            r.candidate,
            r.model,
        )
        for r in found
        if r.same and r is not first
    )
    rest = tuple(r.model for r in found if not r.same and r is not first)
    return Explanation(first.model, swapped + same, rest if first.same else (model, *rest))


def _leader(s: Study, search: Search, model: Model, found: list[Rival]) -> Rival | None:
    """The rival that goes before the model, if any."""
    words = [r for r in found if r.same and two_words(model.candidates[r.replaces], r.candidate)]
    earlier = [r for r in words if _order(r.candidate) < _order(model.candidates[r.replaces])]
    if earlier:
        return min(earlier, key=lambda r: _order(r.candidate))
    top = score(model, search.problem)
    equal = [r for r in found if r not in words and top - score(r.model, search.problem) < EQUAL]

    def key(m: Model) -> tuple[int, list[tuple[int, bool, int, int]]]:
        return m.freedom, sorted(
            coarseness(c, k, s.description) for c, k in zip(m.candidates, m.sizes(), strict=True)
        )

    best = min(equal, key=lambda r: key(r.model), default=None)
    return best if best is not None and key(best.model) < key(model) else None


def _order(c: Candidate) -> int:
    return registry.kinds().index(c.kind)
