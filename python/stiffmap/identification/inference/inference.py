"""From readings to a set of names: the stages one after the other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.common.one_thread import on_one_thread
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.noise.level import noise_of
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.calibration.certificate import certified
from stiffmap.identification.calibration.unknowns import unknowns
from stiffmap.identification.diagnosis.candidates.plan import plan_of
from stiffmap.identification.inference.columns import Columns, columns
from stiffmap.identification.inference.names import Chosen, Search, searched
from stiffmap.model.description import AppliedEffect
from stiffmap.solve.machine import Machine


@on_one_thread
def inferred(machine: Machine, experiment: Experiment) -> tuple[Columns, Search]:
    """The columns of an experiment, and the set of effects with the best evidence."""
    predictor = Predictor(machine, experiment)
    e = predictor.experiment
    plan = plan_of(predictor)
    uncertain = unknowns(predictor.machine.description, e, certified(None, e))
    found = columns(predictor, plan, noise_of(e).sigma, uncertain)

    def predict(chosen: Sequence[Chosen]) -> Floats:
        try:
            shown = predictor(terms(chosen))
        except StiffmapError:  # too large for the machine: the columns alone must do
            return np.full(len(found), np.nan)
        change = (shown - plan.base)[found.rows, found.channel]
        return found.rotated(change)

    return found, searched(found, predict)


def terms(chosen: Sequence[Chosen]) -> tuple[AppliedEffect, ...]:
    """The effects with their strengths, SI."""
    return tuple(_term(c) for c in chosen)


def _term(c: Chosen) -> AppliedEffect:
    v = c.place.shapes[c.shape].variant
    candidate = c.place.candidate
    given = dict(v.shape)
    given |= {p.name: float(np.clip(value, p.lower, p.upper)) for p, value in c.strengths}
    if v.start is not None:
        given |= v.start(c.values)
    return candidate.term([given.get(p.name, float(p.null or 0.0)) for p in candidate.parameters])
