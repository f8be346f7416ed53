"""Zero of a drive."""

from __future__ import annotations

from stiffmap.model.description import CommandError
from stiffmap.model.effects.library.command import of_command
from stiffmap.model.effects.types import EffectType, Parameter

EFFECT = EffectType(
    kind="zero_offset",
    precedence=90,
    title="zero of a drive",
    doc="The drive stands `error` further along (or about) its axis than commanded, at every stroke.",
    parameters=(
        Parameter("error", "m", -0.1, 0.1, 0.0, 1e-4, "added to the commanded coordinate", angular="rad"),
    ),
    **of_command(lambda placed: CommandError(offset=placed.values["error"])),
)
