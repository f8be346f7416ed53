"""A force that does not act as noted: direction."""

from __future__ import annotations

from stiffmap.model.effects.library.geometry import rotation_of
from stiffmap.model.effects.library.measurement import ANGLES, measured, turned
from stiffmap.model.effects.types import EffectType

EFFECT = EffectType(
    **measured("load_direction", "load", ANGLES),
    precedence=320,
    title="direction of the applied force",
    doc="The force that acts is the declared one turned: f = Rx·Ry·Rz f_declared.",
    frame="base axes; about x, then the turned y, then the twice turned z",
    pivot="the point where the force acts",
    load=lambda wrench, plan, term: turned(wrench, rotation_of(dict(term.parameters))),
)
