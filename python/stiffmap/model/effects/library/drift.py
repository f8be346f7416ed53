"""An instrument whose zero wanders."""

from __future__ import annotations

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import AppliedEffect
from stiffmap.model.effects.evidence import Plan
from stiffmap.model.effects.library.geometry import AXES, translation_of
from stiffmap.model.effects.library.measurement import added, measured
from stiffmap.model.effects.types import EffectType, Option, Parameter


def drift(plan: Plan, term: AppliedEffect) -> Floats:
    """(n, 6) proportional to the order of measurement or to the hours, zero at the first reading.

    StiffmapError where the experiment has no such column.
    """
    per = str(dict(term.options).get("per", "order"))
    column = "hours" if per == "hour" else "order"
    clock = plan.hours if per == "hour" else plan.order
    if clock is None:
        raise StiffmapError(f"{plan.name}: drift per {per} needs a column '{column}'")
    rate = np.concatenate([translation_of(dict(term.parameters), ""), np.zeros(3)])
    return np.asarray((clock - clock.min())[:, None] * rate)


RATES = tuple(Parameter(a, "m", -1e-3, 1e-3, 0.0, 1e-8, f"per reading or per hour, {a}") for a in AXES)

EFFECT = EffectType(
    **measured("drift", "sensor", RATES),
    precedence=370,
    title="drift of the instrument",
    doc="The reading gains the drift times (order - first order), or times the hours since the first reading.",
    frame="axes of the reading",
    options=(Option("per", ("order", "hour"), "what the drift goes with"),),
    needs=("order",),
    reading=added(drift),
)
