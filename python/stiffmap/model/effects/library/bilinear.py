"""A drive or spring whose stiffness changes at a force."""

from __future__ import annotations

from functools import partial

from stiffmap.model.description import Law
from stiffmap.model.effects.evidence import shares_of_load
from stiffmap.model.effects.library.drive_law import linear, on_law
from stiffmap.model.effects.types import EffectType, Parameter, Placed

KNEES = (0.1, 0.25, 0.5, 0.8)
"""Shares of the largest load at which the compliance may change."""


def law(old: Law, placed: Placed) -> Law:
    """A polyline through the knees, continued with the other slope; plain at ratio 1."""
    ratio, knee = placed.values["ratio"], placed.values["knee"]
    a = knee / linear(old).stiffness
    return old if ratio == 1.0 else Law(old.stiffness / ratio, knots=((-a, -knee), (a, knee)))


EFFECT = EffectType(
    kind="bilinear",
    precedence=40,
    title="spring whose stiffness changes at a force",
    doc=(
        "The nominal compliance up to the force `knee` in both directions, `ratio` times it for the force "
        "beyond (a preloaded screw that opens, a stop that closes); of a drive, an elastic joint or an uncoupled "
        "direction of a link spring (element `foot.k22`)."
    ),
    parameters=(
        Parameter("ratio", "1", 1e-3, 1e3, 1.0, 0.1, "compliance beyond the knee over the declared one"),
        Parameter(
            "knee", "N", 1e-3, 1e6, None, 100.0, "force at which the compliance changes", angular="N·m"
        ),
    ),
    **on_law(law),
    signature=partial(shares_of_load, name="knee", shares=KNEES),
    excludes=("bilinear", "dead_zone", "hardening", "friction", "position_dependent_compliance", "tabulated"),
)
