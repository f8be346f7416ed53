"""A force that does not act as noted: direction."""

from __future__ import annotations

from stiffmap.common.broadcasting import Floats
from stiffmap.model.description import AppliedEffect
from stiffmap.model.effects.evidence import Plan
from stiffmap.model.effects.library.measurement import ANGLES, measured, rotation, turned


def load(wrench: Floats, plan: Plan, term: AppliedEffect) -> Floats:
    """The wrench turned."""
    return turned(wrench, rotation(dict(term.parameters)))


EFFECT = measured(
    "load_direction",
    "direction of the applied force",
    "The force that acts is the declared one turned: f = Rx·Ry·Rz f_declared.",
    "load",
    ANGLES,
    320,
    frame="base axes; about x, then the turned y, then the twice turned z",
    pivot="the point where the force acts",
    load=load,
)
