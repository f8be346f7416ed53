"""docs/arguments.md against all public signatures: names, defaults and order."""

from __future__ import annotations

import inspect
import re
from collections import defaultdict
from pathlib import Path
from typing import Any

import pytest

import stiffmap as sm

PAGE = (Path(__file__).parents[3] / "docs/arguments.md").read_text(encoding="utf-8")
REQUIRED = "required"
NOT_LISTED = {"self", "parameters", "state"}
"""A mapping of names that the call does not know."""


def rows(heading: str) -> list[list[str]]:
    """Cells of the table under a heading of the page."""
    part = PAGE.split(f"## {heading}", 1)[1].split("\n## ", 1)[0]
    lines = [line for line in part.splitlines() if line.startswith("|")][2:]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def names(cell: str) -> list[str]:
    return re.findall(r"`([\w.()]+)`", cell)


def defaults(cell: str) -> list[str]:
    return [REQUIRED] if cell == REQUIRED else re.findall(r"`([^`]+)`", cell)


def calls() -> dict[str, Any]:
    """Public functions, and methods of the classes that users call."""
    out = {}
    for name in sm.__all__:
        value = getattr(sm, name)
        if inspect.isfunction(value):
            out[name] = value
        elif value is sm.Machine:
            methods = {
                k: m for k, m in vars(value).items() if inspect.isfunction(m) and not k.startswith("_")
            }
            out |= {f"{name}.{k}": m for k, m in methods.items()}
    return out


def default_of(parameter: inspect.Parameter) -> str:
    return REQUIRED if parameter.default is parameter.empty else repr(parameter.default)


TABLE = {
    n: cells[2].strip("`") for cells in rows("Arguments that several calls share") for n in names(cells[0])
}
OTHERWISE = {
    (call, cells[1].strip("`")): defaults(cells[2])
    for cells in rows("Other defaults")
    for call in names(cells[0])
}


def shared() -> dict[str, list[tuple[str, str]]]:
    """Argument -> (call, default) wherever two calls or more have it."""
    found = defaultdict(list)
    for call, function in calls().items():
        for p in inspect.signature(function).parameters.values():
            found[p.name].append((call, default_of(p)))
    return {n: uses for n, uses in found.items() if len(uses) > 1 and n not in NOT_LISTED}


@pytest.mark.parametrize("argument", sorted(shared()))
def test_shared_arguments_have_the_defaults_of_the_table(argument: str) -> None:
    assert argument in TABLE, (
        f"docs/arguments.md lacks {argument}, which {[c for c, _ in shared()[argument]]} take"
    )
    for call, default in shared()[argument]:
        allowed = OTHERWISE.get((call, argument), [TABLE[argument]])
        assert default in allowed, f"{call}({argument}={default}): docs/arguments.md has {allowed}"


def test_the_table_has_no_rows_that_nothing_uses() -> None:
    everywhere = {p for f in calls().values() for p in inspect.signature(f).parameters}
    assert not set(TABLE) - everywhere
    unused = {
        (c, a) for c, a in OTHERWISE if c not in calls() or a not in inspect.signature(calls()[c]).parameters
    }
    assert not unused
