"""The base yields."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.model.description import MachineDescription
from stiffmap.model.effects.edit import fresh
from stiffmap.model.effects.library.spring import PARAMETERS, PIVOT, spring_about
from stiffmap.model.effects.sites import at
from stiffmap.model.effects.types import EffectType, Placed


def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
    """An isotropic spring before everything else."""
    name = fresh("base_compliance", description.base)
    return replace(description, base=(*spring_about(name, placed), *description.base))


EFFECT = EffectType(
    kind="base_compliance",
    precedence=260,
    title="compliance of the base",
    doc=(
        "An isotropic spring in translation and rotation between the ground, from which readings are taken, "
        "and the machine's base."
    ),
    parameters=(*PARAMETERS, *PIVOT),
    places=at("base"),
    apply=apply,
    pivot="the point `pivot_x`, `pivot_y`, `pivot_z` in base axes (default: origin of the base)",
    frame="base axes (isotropic)",
    moves="the whole machine",
    vector=("translation", "rotation"),
    excludes=("base_compliance",),
    stage=50,
    hidden=lambda plan: "base" in (plan.loop.instrument_on, plan.loop.force_against),
)
