"""Lead (scale) error of a drive."""

from __future__ import annotations

from stiffmap.model.description import CommandError, MachineDescription
from stiffmap.model.effects.library.command import add_command_error
from stiffmap.model.effects.sites import at_sites, drives
from stiffmap.model.effects.types import EffectType, Parameter, Placed


def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
    """A command error that grows from the home coordinate."""
    slope = placed.values["slope"]
    return add_command_error(description, placed, CommandError(slope=slope, reference=None))


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
    places=at_sites(drives),
    apply=apply,
    pivot="the drive's home coordinate",
    frame="the drive's axis",
    moves="all that the drive carries",
)
