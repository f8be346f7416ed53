"""A force that does not act as noted: size."""

from __future__ import annotations

from stiffmap.common.broadcasting import Floats
from stiffmap.model.description import AppliedEffect
from stiffmap.model.effects.evidence import Plan
from stiffmap.model.effects.library.measurement import gains, measured, scaled


def load(wrench: Floats, plan: Plan, term: AppliedEffect) -> Floats:
    """The wrench times the gains."""
    return scaled(wrench, dict(term.parameters))


EFFECT = measured(
    "load_gain",
    "gain of the force measurement",
    "The force that acts is the declared one times gain, per axis times gain·gain_axis.",
    "load",
    gains("acting force over declared force"),
    330,
    load=load,
)
