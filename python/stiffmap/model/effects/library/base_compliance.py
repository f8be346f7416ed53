"""The base yields."""

from __future__ import annotations

from stiffmap.model.effects.library.spring import spring_at
from stiffmap.model.effects.types import EffectType

EFFECT = EffectType(
    kind="base_compliance",
    precedence=260,
    title="compliance of the base",
    doc=(
        "An isotropic spring in translation and rotation between the ground, from which readings are taken, "
        "and the machine's base."
    ),
    **spring_at("base"),
    pivot="the point `pivot_x`, `pivot_y`, `pivot_z` in base axes (default: origin of the base)",
    frame="base axes (isotropic)",
    moves="the whole machine",
    excludes=("base_compliance",),
    hidden=lambda plan: "base" in (plan.loop.instrument_on, plan.loop.force_against),
)
