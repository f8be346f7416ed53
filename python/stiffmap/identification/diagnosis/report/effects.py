"""Named effects with their intervals, aliases and definitions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from stiffmap.experiment.experiment import Floats
from stiffmap.identification.candidates.candidates import Candidate
from stiffmap.identification.diagnosis.report.findings import Effect
from stiffmap.identification.inference.corrected import WIDE, Corrected, Term
from stiffmap.model.description import MachineDescription
from stiffmap.model.effects import Placed, registry


def effects_of(
    description: MachineDescription,
    found: Corrected,
    aliases: Sequence[Sequence[Candidate]],
    evidence: Sequence[dict[str, float]],
) -> list[Effect]:
    """The effects of an optimum with their 95 % intervals, SI; `aliases` and `evidence` per effect."""
    sd = np.sqrt(np.maximum(np.diag(found.covariance), 0.0))
    ends = np.cumsum([0, *(len(t.values) for t in found.terms)])
    return [
        _effect(description, term, sd[a:b], same, how)
        for term, a, b, same, how in zip(found.terms, ends[:-1], ends[1:], aliases, evidence, strict=True)
    ]


def _effect(
    description: MachineDescription,
    term: Term,
    sd: Floats,
    aliases: Sequence[Candidate],
    evidence: dict[str, float],
) -> Effect:
    c = term.candidate
    scale = np.array([p.scale for p in c.parameters])
    low, high = term.bounds
    ends = np.stack([term.values - WIDE * sd, term.values + WIDE * sd], axis=1)
    inside = np.clip(ends, low[:, None], high[:, None])
    limits, values = inside * scale[:, None], term.values * scale
    parameters = {
        p.name: (float(v), float(a), float(b), p.unit)
        for p, v, (a, b) in zip(c.parameters, values, limits, strict=True)
    }
    cut = [
        f"{p.name} {side}"
        for p, e, i in zip(c.parameters, ends, inside, strict=True)
        for side, x, y in zip(("lower", "upper"), e, i, strict=True)
        if x != y and (p.null is None or y * p.scale != p.null)
    ]
    return Effect(
        c.kind,
        c.element,
        c.legs,
        parameters | _derived(description, c, np.column_stack([values, limits])),
        [as_place(a) for a in aliases],
        evidence,
        definition(c),
        tuple(cut),
    )


def _derived(
    description: MachineDescription, candidate: Candidate, rows: Floats
) -> dict[str, tuple[float, float, float, str]]:
    effect = registry.get(candidate.kind)
    if effect.derived is None or len(rows) != 1:
        return {}
    name = candidate.parameters[0].name
    found = [
        effect.derived(description, Placed(candidate.kind, candidate.element, candidate.legs, {name: v}, {}))
        for v in rows[0]
    ]
    at = effect.parameters_at(description, candidate.element, candidate.legs)
    units = {p.name: p.unit for p in at}
    return {
        n: (found[0][n], min(found[1][n], found[2][n]), max(found[1][n], found[2][n]), units.get(n, ""))
        for n in found[0]
    }


def as_place(candidate: Candidate) -> dict[str, Any]:
    """Kind, element, legs."""
    return {"kind": candidate.kind, "element": candidate.element, "legs": list(candidate.legs)}


def definition(candidate: Candidate) -> str:
    """What the effect is, its pivot, frame and what moves with it."""
    e = registry.get(candidate.kind)
    return f"{e.doc} Pivot: {e.pivot}. Frame: {e.frame}. Moves: {e.moves}."
