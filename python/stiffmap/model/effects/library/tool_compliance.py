"""The tool, its holder or the fixture yields."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.model.description import MachineDescription
from stiffmap.model.effects.edit import fresh
from stiffmap.model.effects.library.spring import PARAMETERS, PIVOT, spring_about
from stiffmap.model.effects.sites import at
from stiffmap.model.effects.types import EffectType, Placed


def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
    """An isotropic spring behind all platform elements."""
    name = fresh("tool_compliance", description.platform)
    return replace(description, platform=(*description.platform, *spring_about(name, placed)))


EFFECT = EffectType(
    kind="tool_compliance",
    precedence=270,
    title="compliance of tool and holder",
    doc=(
        "An isotropic spring in translation and rotation between the platform and the tool, on which the "
        "load acts and the reading is taken."
    ),
    parameters=(*PARAMETERS, *PIVOT),
    places=at("platform"),
    apply=apply,
    pivot="the point `pivot_x`, `pivot_y`, `pivot_z` from the TCP in platform axes (default: the TCP)",
    frame="platform axes (isotropic)",
    moves="the TCP; other points and bodies of the platform stay",
    vector=("translation", "rotation"),
    excludes=("tool_compliance",),
    stage=50,
    behind_platform=True,
    hidden=lambda plan: plan.loop.target_on == "platform",
)
