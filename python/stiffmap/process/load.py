"""Reading process files, and those that come with stiffmap."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

from stiffmap.errors import FileError, StiffmapError
from stiffmap.files.schema.base import suggestion
from stiffmap.process.build import process_of
from stiffmap.process.description import Process
from stiffmap.yaml_text import Document, read

FOLDER = Path(__file__).with_name("library")


def process_names() -> list[str]:
    """Names of the processes that come with stiffmap."""
    return sorted(p.stem for p in FOLDER.glob("*.yaml"))


def load_process(name_path_or_dict: str | PathLike[str] | Mapping[str, Any]) -> Process:
    """A process by its shipped name (``trimming``, ``slot``), from a file, or from a mapping with the file's keys.

    Numbers carry units there (docs/milling.md); the result is in SI. Raises FileError naming file, line, key,
    what was expected and what was found.
    """
    if isinstance(name_path_or_dict, Mapping):
        return process_of(Document(dict(name_path_or_dict)), "process")
    if not isinstance(name_path_or_dict, str | PathLike):
        raise StiffmapError(
            f"process: expected a name, a file or a mapping; got {type(name_path_or_dict).__name__}"
        )
    if str(name_path_or_dict) in process_names():
        path = FOLDER / f"{name_path_or_dict}.yaml"
    else:
        path = Path(name_path_or_dict)
    if not path.is_file():
        known = process_names()
        raise FileError(
            f"no such process file, and no process of that name is shipped{suggestion(path.stem, known)}; "
            f"these are: {', '.join(known)}",
            file=str(name_path_or_dict),
        )
    return process_of(read(path), str(path))
