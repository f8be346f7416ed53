"""Models to named effects with intervals, aliases and definitions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.noise.level import Mask
from stiffmap.identification.diagnosis.candidates.candidates import Candidate
from stiffmap.identification.diagnosis.fitting.fit import fit_without
from stiffmap.identification.diagnosis.fitting.interval import intervals
from stiffmap.identification.diagnosis.fitting.model import Model
from stiffmap.identification.diagnosis.report.findings import Effect
from stiffmap.identification.diagnosis.search.alias import AliasClass
from stiffmap.identification.diagnosis.search.selection import Search, minus_log_p_of
from stiffmap.identification.diagnosis.search.significance import global_p
from stiffmap.identification.diagnosis.search.study import Study
from stiffmap.model.effects import Placed, registry


def named_effects(study: Study, search: Search, model: Model, inflation: float = 1.0) -> list[Effect]:
    """The effects of a model, values and 95 % intervals in SI."""
    if not model.candidates:
        return []
    spent = study.clock.spent
    if spent:
        study.clock.leave_out("intervals by refits: they are those of a straight line")
    ends = intervals(model, search.predictor, search.problem, inflation, straight=spent)
    limits = ends.values * model.scales[:, None]
    return [
        Effect(
            candidate.kind,
            candidate.element,
            candidate.legs,
            _parameters(study, candidate, model.si[part], limits[part]),
            aliases_of(study.classes, candidate),
            _evidence(search, model, i),
            definition(candidate),
            _open_ends(candidate, ends.found[part]),
        )
        for i, (candidate, part) in enumerate(zip(model.candidates, model.parts(), strict=True))
    ]


def _open_ends(candidate: Candidate, found: Mask) -> tuple[str, ...]:
    """Ends of intervals that were not found: ``scale upper``."""
    names = [f"{p.name} {side}" for p in candidate.parameters for side in ("lower", "upper")]
    return tuple(n for n, ok in zip(names, found.ravel(), strict=True) if not ok)


def _parameters(
    study: Study, candidate: Candidate, values: Floats, limits: Floats
) -> dict[str, tuple[float, float, float, str]]:
    out = {
        p.name: (float(v), float(low), float(high), p.unit)
        for p, v, (low, high) in zip(candidate.parameters, values, limits, strict=True)
    }
    return out | _derived(study, candidate, np.column_stack([values, limits]))


def _derived(study: Study, candidate: Candidate, rows: Floats) -> dict[str, tuple[float, float, float, str]]:
    effect = registry.get(candidate.kind)
    if effect.derived is None or len(rows) != 1:
        return {}
    found = [
        effect.derived(
            study.description,
            Placed(candidate.kind, candidate.element, candidate.legs, {candidate.parameters[0].name: v}, {}),
        )
        for v in rows[0]
    ]
    at = effect.parameters_at(study.description, candidate.element, candidate.legs)
    units = {p.name: p.unit for p in at}
    return {
        n: (found[0][n], min(found[1][n], found[2][n]), max(found[1][n], found[2][n]), units.get(n, ""))
        for n in found[0]
    }


def _evidence(search: Search, model: Model, i: int) -> dict[str, float]:
    reduced = fit_without(model, i, search.predictor, search.problem)
    delta_chi2 = reduced.chi2 - model.chi2
    minus_log_p = minus_log_p_of(delta_chi2, len(model.candidates[i].parameters))
    return {
        "delta_chi2": delta_chi2,
        "minus_ln_p": minus_log_p,
        "p_global": global_p(minus_log_p, search.effective_trials),
    }


def aliases_of(classes: Sequence[AliasClass], candidate: Candidate) -> list[dict[str, Any]]:
    """Members of the candidate's class, then candidates with more parameters that contain it."""
    for c in classes:
        if c.representative == candidate:
            return [as_place(m) for m in (*c.members, *c.generalisations)]
    return []


def as_place(candidate: Candidate) -> dict[str, Any]:
    """Kind, element, legs."""
    return {"kind": candidate.kind, "element": candidate.element, "legs": list(candidate.legs)}


def definition(candidate: Candidate) -> str:
    """What the effect is, its pivot, frame and what moves with it."""
    e = registry.get(candidate.kind)
    return f"{e.doc} Pivot: {e.pivot}. Frame: {e.frame}. Moves: {e.moves}."
