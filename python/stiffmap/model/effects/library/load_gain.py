"""A force that does not act as noted: size."""

from __future__ import annotations

from stiffmap.model.effects.library.measurement import gains, measured, scaled
from stiffmap.model.effects.types import EffectType

EFFECT = EffectType(
    **measured("load_gain", "load", gains("acting force over declared force")),
    precedence=330,
    title="gain of the force measurement",
    doc="The force that acts is the declared one times gain, per axis times gain·gain_axis.",
    frame="base axes",
    load=lambda wrench, plan, term: scaled(wrench, dict(term.parameters)),
)
