"""What the errors of a commanded coordinate share."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.model.description import CommandError, Element, Joint, MachineDescription
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.edit import Sites, change_sites
from stiffmap.model.effects.sites import drives
from stiffmap.model.effects.types import Placed


def add_command_error(
    description: MachineDescription, placed: Placed, error: CommandError, sites: Sites = drives
) -> MachineDescription:
    """One more error on each drive of the place, which `sites` name."""

    def change(e: Element) -> Elements:
        assert isinstance(e, Joint)
        return (replace(e, command_errors=(*e.command_errors, error)),)

    return change_sites(description, placed.legs, placed.element, sites, change)
