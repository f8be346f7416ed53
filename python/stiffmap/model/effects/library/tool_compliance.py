"""The tool, its holder or the fixture yields."""

from __future__ import annotations

from stiffmap.model.effects.library.spring import spring_at
from stiffmap.model.effects.types import EffectType

EFFECT = EffectType(
    kind="tool_compliance",
    precedence=270,
    title="compliance of tool and holder",
    doc=(
        "An isotropic spring in translation and rotation between the platform and the tool, on which the "
        "load acts and the reading is taken."
    ),
    **spring_at("platform"),
    pivot="the point `pivot_x`, `pivot_y`, `pivot_z` from the TCP in platform axes (default: the TCP)",
    frame="platform axes (isotropic)",
    moves="the TCP; other points and bodies of the platform stay",
    excludes=("tool_compliance",),
    behind_platform=True,
    hidden=lambda plan: plan.loop.target_on == "platform",
)
