"""Periodic error of a screw or gear."""

from __future__ import annotations

import math

from stiffmap.description import CommandError, MachineDescription
from stiffmap.effects.library.command import add_command_error
from stiffmap.effects.library.drive_law import in_unit_of_joint
from stiffmap.effects.sites import at_sites, drives
from stiffmap.effects.types import EffectType, Parameter, Placed

PARAMETERS = (
    Parameter("amplitude", "m", 0.0, 0.01, 0.0, 1e-5, "half of peak to peak", angular="rad"),
    Parameter("period", "m", 1e-5, 10.0, None, 0.01, "travel after which the error repeats", angular="rad"),
    Parameter(
        "phase",
        "rad",
        -2 * math.pi,
        2 * math.pi,
        None,
        1.0,
        "of the sine at the home coordinate",
        default=0.0,
    ),
)


def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
    """amplitude sin(2 pi (u - home) / period + phase)."""
    a, period, phase = (placed.values[n] for n in ("amplitude", "period", "phase"))
    return add_command_error(
        description,
        placed,
        CommandError(amplitude=a, period=period, phase=phase, reference=None),
    )


EFFECT = EffectType(
    kind="periodic_error",
    title="periodic error of a screw or gear",
    doc=(
        "The drive stands amplitude·sin(2π(u - u_home)/period + phase) further than commanded at the "
        "coordinate u."
    ),
    parameters=PARAMETERS,
    places=at_sites(drives),
    apply=apply,
    pivot="the drive's home coordinate",
    frame="the drive's axis",
    moves="all that the drive carries",
    at=in_unit_of_joint(*PARAMETERS),
)
