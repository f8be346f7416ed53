"""From readings to a set of names: the stages one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.common.tasks import on_one_thread
from stiffmap.experiment.experiment import Experiment, Floats, Mask
from stiffmap.experiment.noise.level import Noise
from stiffmap.experiment.noise.outliers import without_suspects
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.candidates.plan import CandidatePlan, plan_of
from stiffmap.identification.clock import Clock
from stiffmap.identification.inference.chosen import Chosen
from stiffmap.identification.inference.columns import Columns, columns
from stiffmap.identification.inference.names import Search, searched
from stiffmap.identification.numbers.certificate import Tolerances, certified
from stiffmap.identification.numbers.unknowns import Unknown, unknowns
from stiffmap.model import effects
from stiffmap.model.description import AppliedEffect
from stiffmap.solve.machine import Machine


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


@on_one_thread
def inferred(machine: Machine, experiment: Experiment) -> tuple[Columns, Search]:
    """The columns of an experiment, and the set of effects with the best evidence."""
    predictor = Predictor(machine, experiment)
    found = infer(predictor, plan_of(predictor))
    return found.columns, found.search


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
    every = unknowns(predictor.machine.description, e, certified(tolerances, e))
    uncertain = tuple(u for u in every if u.group not in exclude)
    clock.say("columns of the declared numbers")
    found = columns(predictor, plan, noise.sigma, uncertain, seed)

    used = np.isin(np.arange(len(e)), found.rows)
    drawn = predictor if used.all() else predictor.beside(rows=used)
    at = (np.cumsum(used) - 1)[found.rows], found.channel
    before = plan.base[found.rows, found.channel]

    def predict(chosen: Sequence[Chosen]) -> Floats:
        added = terms(chosen)
        whole = any(effects.get(t.kind).drive for t in added)  # what drives remember is of the rows before
        try:
            shown = predictor(added)[used] if whole else drawn(added)
        except StiffmapError:  # too large for the machine: the columns alone must do
            return np.full(len(found), np.nan)
        return found.rotated(shown[at] - before)

    clock.say("all effects at once")
    search = searched(found, predict, lambda: clock.over, travel=travel)
    return Inferred(plan, noise, suspects, uncertain, found, search)


def terms(chosen: Sequence[Chosen]) -> tuple[AppliedEffect, ...]:
    """The effects with their strengths, SI."""
    out = []
    for c in chosen:
        given = dict(c.variant.shape) | dict(c.refined)
        given |= {p.name: float(np.clip(value, p.lower, p.upper)) for p, value in c.strengths}
        if c.variant.start is not None:
            given |= c.variant.start(c.values)
        out.append(c.place.candidate.term_of(given))
    return tuple(out)
