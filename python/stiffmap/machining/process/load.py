"""Reading process files, and those that come with stiffmap."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path

from stiffmap.common.errors import FileError, refuse_folder, suggestion
from stiffmap.common.yaml_text import Document, read
from stiffmap.machining.process.build import process_of
from stiffmap.machining.process.description import Process

GivenProcess = Process | str | PathLike[str] | Mapping[str, object]
FOLDER = Path(__file__).with_name("library")


def process_names() -> list[str]:
    """Names of the processes that come with stiffmap."""
    return sorted(p.stem for p in FOLDER.glob("*.yaml"))


def as_process(given: GivenProcess) -> Process:
    """The process itself, or the one that `load_process` finds."""
    return given if isinstance(given, Process) else load_process(given)


def load_process(source: str | PathLike[str] | Mapping[str, object]) -> Process:
    """A process by its shipped name (``trimming``, ``slot``), from a file, or from a mapping with the file's keys.

    Numbers carry units there (docs/milling.md); the result is in SI. Raises FileError naming file, line, key,
    what was expected and what was found.
    """
    if isinstance(source, Mapping):
        return process_of(Document(dict(source)), "process")
    path = FOLDER / f"{source}.yaml" if str(source) in process_names() else Path(source)
    if not path.is_file():
        refuse_folder(source, "a process file or the name of a shipped process")
        known = process_names()
        raise FileError(
            f"no such process file, and no process of that name is shipped{suggestion(path.stem, known)}; "
            f"these are: {', '.join(known)}",
            file=str(source),
        )
    return process_of(read(path), str(path))
