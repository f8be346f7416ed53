"""Where a cable enters its guide."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.model.description import Cable
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.library.geometry import components
from stiffmap.model.effects.sites import cables, each
from stiffmap.model.effects.types import EffectType, Parameter, Placed

OFF = tuple(
    Parameter(n, "m", -1.0, 1.0, 0.0, 1e-3, f"real minus declared anchor, {n[1]}", default=0.0)
    for n in ("dx", "dy", "dz")
)


def displaced(e: Cable, placed: Placed) -> Elements:
    """The controller computes its lengths with the declared anchor."""
    x, y, z = e.anchor_error
    dx, dy, dz = (placed.values[p.name] for p in OFF)
    return (replace(e, anchor_error=(x + dx, y + dy, z + dz)),)


EFFECT = EffectType(
    kind="cable_anchor",
    precedence=165,
    title="anchor of a cable",
    doc="The cable enters its guide (dx, dy, dz) away from where its controller believes.",
    **components(OFF),
    **each(cables, displaced),
    frame="base axes",
    moves="nothing",
)
