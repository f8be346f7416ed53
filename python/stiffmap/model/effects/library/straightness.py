"""Straightness of a guide: a deviation across the stroke."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import GuideError, Joint
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.library import periodic_error
from stiffmap.model.effects.sites import each, guides
from stiffmap.model.effects.types import EffectType, Option, Placed

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
AMPLITUDE, PERIOD, PHASE = periodic_error.PARAMETERS
PARAMETERS = (
    replace(AMPLITUDE, doc="largest deviation", angular=""),
    replace(PERIOD, scale=1.0, doc="travel after which the deviation repeats", angular=""),
    PHASE,
)


def bent(e: Joint, placed: Placed) -> Elements:
    """One harmonic of the deviation, on each guide of the place."""
    axis = AXES[placed.options["across"]]
    along = sum(a * b for a, b in zip(axis, e.axes[0], strict=True))
    if abs(along) > 1e-9:
        raise StiffmapError(f"across={placed.options['across']} is not across the guide {e.axes[0]}")
    error = GuideError(axis, periodic_error.wave(placed))
    return (replace(e, guide_errors=(*e.guide_errors, error)),)


EFFECT = EffectType(
    kind="straightness",
    precedence=120,
    title="straightness of a guide",
    doc=(
        "The carriage stands amplitude·sin(2π(u - u_home)/period + phase) off its guide at the commanded coordinate u, "
        "along the axis `across` of the guide's frame. One harmonic of the deviation; several add up. A bow over a "
        "stroke s is the half wave period = 2s."
    ),
    parameters=PARAMETERS,
    **each(guides, bent),
    pivot="the drive's home coordinate",
    frame="axes of the guide before it moves",
    moves="all that the drive carries, without turning",
    options=(Option("across", ("y", "z", "x"), "direction of the deviation, at right angles to the guide"),),
    stage=5,
    tried=lambda description: [],
)
