"""A force that does not act as noted: size."""

from __future__ import annotations

from stiffmap.model.effects.library.measurement import gains, measured, scaled

EFFECT = measured(
    "load_gain",
    "gain of the force measurement",
    "The force that acts is the declared one times gain, per axis times gain·gain_axis.",
    "load",
    gains("acting force over declared force"),
    330,
    load=lambda wrench, plan, term: scaled(wrench, dict(term.parameters)),
)
