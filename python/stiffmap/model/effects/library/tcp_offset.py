"""Position of the tool on the platform."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.model.description import MachineDescription, Pose
from stiffmap.model.effects.edit import built, fresh
from stiffmap.model.effects.library.geometry import translation_of, translations
from stiffmap.model.effects.sites import at
from stiffmap.model.effects.types import EffectType, Placed


def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
    """An offset behind all platform elements."""
    new = built(fresh("tcp_offset", description.platform), Pose.of(translation_of(placed.values)))
    return replace(description, platform=(*description.platform, new))


EFFECT = EffectType(
    kind="tcp_offset",
    precedence=220,
    title="position of the tool on the platform",
    doc="The tool (TCP) sits displaced on the platform; the external wrench acts at the displaced TCP.",
    **translations("displacement of the tool"),
    places=at("platform"),
    apply=apply,
    frame="platform axes",
    moves="the TCP; other points and bodies of the platform stay",
    stage=60,
)
