"""Lead (scale) error of a drive."""

from __future__ import annotations

from stiffmap.model.description import CommandError
from stiffmap.model.effects.library.command import of_command
from stiffmap.model.effects.types import EffectType, Parameter

EFFECT = EffectType(
    kind="lead_error",
    precedence=100,
    title="lead error of a drive",
    doc="The drive travels `slope` more per unit of commanded travel; no error at its home coordinate.",
    parameters=(
        Parameter(
            "slope", "m/m", -0.1, 0.1, 0.0, 1e-4, "error per commanded travel from home", angular="rad/rad"
        ),
    ),
    **of_command(lambda placed: CommandError(slope=placed.values["slope"], reference=None)),
    pivot="the drive's home coordinate",
)
