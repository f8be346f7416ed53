"""What the errors of a commanded coordinate share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from stiffmap.model.description import CommandError, Joint
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.edit import Sites
from stiffmap.model.effects.sites import drives, each
from stiffmap.model.effects.types import Placed


def of_command(error: Callable[[Placed], CommandError], sites: Sites = drives) -> dict[str, Any]:
    """What effects share that add an error to the commands of drives, which `sites` name."""

    def with_error(e: Joint, placed: Placed) -> Elements:
        return (replace(e, command_errors=(*e.command_errors, error(placed))),)

    return {
        **each(sites, with_error),
        "frame": "the drive's axis",
        "moves": "all that the drive carries",
    }
