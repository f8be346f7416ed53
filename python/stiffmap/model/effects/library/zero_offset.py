"""Zero of a drive."""

from __future__ import annotations

from stiffmap.model.description import CommandError, MachineDescription
from stiffmap.model.effects.library.command import add_command_error
from stiffmap.model.effects.library.drive_law import in_unit_of_joint
from stiffmap.model.effects.sites import at_sites, drives
from stiffmap.model.effects.types import EffectType, Parameter, Placed

ERROR = Parameter("error", "m", -0.1, 0.1, 0.0, 1e-4, "added to the commanded coordinate", angular="rad")


def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
    """A constant command error."""
    error = CommandError(offset=placed.values["error"])
    return add_command_error(description, placed, error)


EFFECT = EffectType(
    kind="zero_offset",
    precedence=90,
    title="zero of a drive",
    doc="The drive stands `error` further along (or about) its axis than commanded, at every stroke.",
    parameters=(ERROR,),
    places=at_sites(drives),
    apply=apply,
    frame="the drive's axis",
    moves="all that the drive carries",
    at=in_unit_of_joint(ERROR),
)
