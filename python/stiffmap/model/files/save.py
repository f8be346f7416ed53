"""Writing machine files, with the promise that they load back equal."""

from __future__ import annotations

from dataclasses import fields
from os import PathLike

import yaml

from stiffmap.common.errors import StiffmapError
from stiffmap.common.outputs import write_text
from stiffmap.common.yaml_text import text_of
from stiffmap.model.description import MachineDescription
from stiffmap.model.files.dump import dump
from stiffmap.model.files.load import description_from_text


def save_description(description: MachineDescription, path: str | PathLike[str]) -> None:
    """Write a machine file (SI units) that loads back equal, floats exactly.

    A machine with effects is saved as the declared machine and its effect records.
    Raises `StiffmapError` where a file cannot hold the machine, or cannot be written.
    """
    write_text(path, description_text(description))


def description_text(description: MachineDescription) -> str:
    """The text that `save_description` writes; raises `StiffmapError`."""
    try:
        text = text_of(dump(description))
        back = description_from_text(text, f"machine '{description.name}' as a file")
    except yaml.YAMLError as error:
        raise StiffmapError(f"machine '{description.name}' cannot be saved: {error}") from error
    if back != description:
        changed = [
            f.name
            for f in fields(description)
            if f.compare and getattr(back, f.name) != getattr(description, f.name)
        ]
        raise StiffmapError(
            f"machine '{description.name}' cannot be saved unchanged: a file would not keep its "
            f"{', '.join(changed)}"
        )
    return text
