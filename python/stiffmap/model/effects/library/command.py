"""What the errors of a commanded coordinate share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from stiffmap.model.description import CommandError, Joint, MachineDescription
from stiffmap.model.effects.edit import Sites, change_sites
from stiffmap.model.effects.sites import at_sites, drives
from stiffmap.model.effects.types import Placed


def add_command_error(
    description: MachineDescription, placed: Placed, error: CommandError, sites: Sites = drives
) -> MachineDescription:
    """One more error on each drive of the place, which `sites` name."""

    def change(e: Joint) -> tuple[Joint]:
        return (replace(e, command_errors=(*e.command_errors, error)),)

    return change_sites(description, placed.legs, placed.element, sites, change)


def of_command(error: Callable[[Placed], CommandError], sites: Sites = drives) -> dict[str, Any]:
    """What effects share that add an error to the commands of drives, which `sites` name."""
    return {
        "places": at_sites(sites),
        "apply": lambda machine, placed: add_command_error(machine, placed, error(placed), sites),
        "frame": "the drive's axis",
        "moves": "all that the drive carries",
    }
