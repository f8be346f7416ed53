"""Places in a machine file: ``templates.leg.spring[foot].beam.EIz``, ``workspace.x[0]``."""

from __future__ import annotations

import re
from typing import Any

from stiffmap.common.errors import StiffmapError

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


def put(data: Any, place: str, value: float) -> None:
    """Set a number of a machine file's data, in place; StiffmapError names the step that is not there."""
    holder, key = _holder(data, place)
    if isinstance(holder[key], dict) and "value" in holder[key]:
        holder[key]["value"] = value
    else:
        holder[key] = value


def indices(data: Any, place: str) -> tuple[str | int, ...]:
    """The place as keys and numbers alone; StiffmapError names the step that is not there."""
    at, out = data, list[str | int]()
    for step in steps(place):
        out.append(_key(at, step, place))
        at = at[out[-1]]
    return tuple(out)


def _holder(data: Any, place: str) -> tuple[Any, Any]:
    at, path = data, steps(place)
    for i, step in enumerate(path):
        key = _key(at, step, place)
        if i == len(path) - 1:
            return at, key
        at = at[key]
    raise StiffmapError(f"cannot read the place '{place}'")


def _key(at: Any, step: str | int | tuple[str, str], place: str) -> Any:
    if isinstance(step, tuple):
        sort, name = step
        if isinstance(at, dict) and sort in at and isinstance(at[sort], dict | list):
            raise StiffmapError(f"'{place}': write {sort}.{name}, not {sort}[{name}]")
        found = (
            [i for i, e in enumerate(at) if isinstance(e, dict) and str(e.get(sort)) == name]
            if isinstance(at, list)
            else []
        )
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


def _elements(at: Any) -> list[str]:
    sorts = ("actuator", "joint", "spring", "body", "offset", "block", "point")
    if not isinstance(at, list):
        return []
    return [f"{s}[{e[s]}]" for e in at if isinstance(e, dict) for s in sorts if s in e]


def unshared(data: Any) -> Any:
    """Anchors of YAML are one object in several places: each place gets its own."""
    if isinstance(data, dict):
        return {k: unshared(v) for k, v in data.items()}
    if isinstance(data, list):
        return [unshared(v) for v in data]
    return data
