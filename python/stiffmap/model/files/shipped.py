"""The machines that come with stiffmap, and the template of ``stiffmap new``."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from stiffmap.common.errors import UnknownMachineError, refuse_folder, suggestion
from stiffmap.common.yaml_text import read


@dataclass(frozen=True)
class ShippedMachine:
    """A machine by its name, with its title, the source of its numbers, and its file."""

    name: str
    title: str
    source: str
    path: Path


def machine_folder() -> Path:
    """Folder of the shipped machine files."""
    return Path(__file__).resolve().parent.parent / "machines"


def machine_names() -> list[str]:
    """Names of the machines that come with stiffmap, sorted."""
    return sorted(path.stem for path in machine_folder().glob("*.yaml"))


def shipped_machines() -> list[ShippedMachine]:
    """The shipped machines, sorted by name."""
    machines = []
    for name in machine_names():
        path = machine_folder() / f"{name}.yaml"
        data = read(path).data
        machines.append(ShippedMachine(name, data.get("title", ""), data.get("source", ""), path))
    return machines


def find(name_or_path: str | PathLike[str]) -> Path:
    """File of a shipped machine or of a path; raises `UnknownMachineError`, which lists what exists."""
    names = machine_names()
    if str(name_or_path) in names:
        return machine_folder() / f"{name_or_path}.yaml"
    path = Path(name_or_path)
    if path.is_file():
        return path
    refuse_folder(name_or_path, "a machine file or the name of a shipped machine")
    text = str(name_or_path)
    looks_like_file = path.suffix in (".yaml", ".yml") or len(path.parts) > 1
    what = f"no file '{text}'" if looks_like_file else f"unknown machine '{text}'"
    near = suggestion(path.stem if looks_like_file else text, names)
    raise UnknownMachineError(f"{what}{near}; shipped machines: {', '.join(names)}")


def starter_text(name: str) -> str:
    """Text of a small machine file that loads, with every key explained; ``name`` is the machine's."""
    text = (Path(__file__).parent / "starter.yaml").read_text(encoding="utf-8")
    return text.replace("name: my-machine", f"name: {name}", 1)
