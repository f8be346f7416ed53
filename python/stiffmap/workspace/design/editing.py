"""Places in a machine file (``templates.leg.spring[foot].beam.EIz``, ``workspace.x[0]``), and machines whose numbers there change."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from stiffmap.common.errors import StiffmapError
from stiffmap.common.yaml_text import Document
from stiffmap.model.description import MachineDescription
from stiffmap.model.files.load import describe_document

_STEP = re.compile(r"^([^\[\]]+)?((?:\[[^\[\]]+\])*)$")


def steps(place: str) -> list[str | int | tuple[str, str]]:
    """Keys, indices, and (sort, name) for an element of a chain."""
    out: list[str | int | tuple[str, str]] = []
    for part in place.split("."):
        match = _STEP.match(part)
        if not match or not part:
            raise StiffmapError(f"cannot read the place '{place}'")
        brackets = re.findall(r"\[([^\[\]]+)\]", match[2])
        if match[1] and len(brackets) == 1 and not brackets[0].isdigit():
            out.append((match[1], brackets[0]))
            continue
        if match[1]:
            out.append(match[1])
        out.extend(int(b) if b.isdigit() else b for b in brackets)
    return out


def edited(data: object, values: dict[str, float]) -> Any:
    """A machine file's data with these numbers (place: value); StiffmapError names the step that is not there."""
    data = unshared(data)
    for place, value in values.items():
        _set(data, indices(data, place), value)
    return data


def indices(data: object, place: str) -> tuple[str | int, ...]:
    """The place as keys and numbers alone; StiffmapError names the step that is not there."""
    at: Any = data
    out: list[str | int] = []
    for step in steps(place):
        out.append(_key(at, step, place))
        at = at[out[-1]]
    return tuple(out)


def _key(at: object, step: str | int | tuple[str, str], place: str) -> str | int:
    if isinstance(step, tuple):
        sort, name = step
        if isinstance(at, dict) and sort in at and isinstance(at[sort], dict | list):
            raise StiffmapError(f"'{place}': write {sort}.{name}, not {sort}[{name}]")
        row = at if isinstance(at, list) else []
        found = [i for i, e in enumerate(row) if isinstance(e, dict) and str(e.get(sort)) == name]
        if len(found) != 1:
            known = ", ".join(_elements(at)) or "none"
            raise StiffmapError(
                f"'{place}': expected one {sort} named '{name}', found {len(found)}; here are: {known}"
            )
        return found[0]
    if isinstance(step, int):
        if not isinstance(at, list) or step >= len(at):
            raise StiffmapError(f"'{place}': no entry [{step}] there")
        return step
    if not isinstance(at, dict) or step not in at:
        known = ", ".join(map(str, at)) if isinstance(at, dict) else ", ".join(_elements(at)) or "a number"
        raise StiffmapError(f"'{place}': no '{step}' there; here are: {known}")
    return step


def _elements(at: object) -> list[str]:
    sorts = ("actuator", "joint", "spring", "body", "offset", "block", "point")
    if not isinstance(at, list):
        return []
    return [f"{s}[{e[s]}]" for e in at if isinstance(e, dict) for s in sorts if s in e]


def unshared(data: object) -> Any:
    """Anchors of YAML are one object in several places: each place gets its own."""
    if isinstance(data, dict):
        return {k: unshared(v) for k, v in data.items()}
    if isinstance(data, list):
        return [unshared(v) for v in data]
    return data


def described(data: object, document: Document, file: str) -> MachineDescription:
    """The machine of a file's data, with the lines of its document."""
    return describe_document(Document(data, document.lines), file, Path(file).parent)


def _set(raw: Any, path: tuple[str | int, ...], value: float) -> None:
    for key in path[:-1]:
        raw = raw[key]
    last = path[-1]
    if isinstance(raw[last], dict) and "value" in raw[last]:
        raw[last]["value"] = value
    else:
        raw[last] = value
