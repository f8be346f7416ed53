"""docs/arguments.md against all public signatures: names, defaults, order, and names that are deprecated."""

from __future__ import annotations

import inspect
import re
import warnings
from collections import defaultdict
from pathlib import Path
from typing import Any

import pytest

import stiffmap as sm
from stiffmap.common.deprecation import renamed

PAGE = (Path(__file__).parents[3] / "docs/arguments.md").read_text(encoding="utf-8")
REQUIRED = "required"
NOT_LISTED = {"self", "options", "parameters", "state"}
"""Deprecated everywhere, or a mapping of names that the call does not know."""


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
EARLIER = {
    (call, old) for cells in rows("Earlier names") for call in names(cells[0]) for old in names(cells[1])
}


def shared() -> dict[str, list[tuple[str, str]]]:
    """Argument -> (call, default) wherever two calls or more have it."""
    found = defaultdict(list)
    for call, function in calls().items():
        if call == "assembly_stress":
            continue
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


def test_earlier_names_are_those_of_the_page() -> None:
    marked = {(call, old) for call, f in calls().items() for old in getattr(f, "__deprecated_names__", {})}
    assert marked == {(c, a) for c, a in EARLIER if a != "options"}
    assert {c for c, a in EARLIER if a == "options"} == {
        c for c, f in calls().items() if "options" in inspect.signature(f).parameters
    }


@pytest.mark.parametrize("call", sorted({c for c, a in EARLIER if a != "options"}))
def test_no_call_has_both_an_earlier_name_and_its_new_one(call: str) -> None:
    parameters = inspect.signature(calls()[call]).parameters
    for old, new in calls()[call].__deprecated_names__.items():
        assert new in parameters and old not in parameters


def test_an_earlier_name_works_and_warns_with_the_new_one() -> None:
    @renamed(old="new")
    def call(new: int = 0) -> int:
        return new

    with pytest.warns(DeprecationWarning, match=r"call\(old=\) is deprecated .* use call\(new=\)") as caught:
        assert call(old=3) == 3  # type: ignore[call-arg]
    assert caught[0].filename == __file__
    with pytest.raises(TypeError, match="both 'new' and 'old'"):
        call(1) if call(new=1) == 0 else call(new=1, old=2)  # type: ignore[call-arg]


def test_earlier_calls_of_the_library_answer_as_the_new_ones_do() -> None:
    machine, p, w = sm.load_machine("orthoglide-revised"), [0.1, 0.0, 0.0], [100.0, 0, 0, 0, 0, 0]
    from stiffmap.solve.options import SolveOptions

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        new = machine.solve(p, w, gravity=(0, 0, -9.81)).displacement
        polar = sm.polar(machine, p, directions=3, method="reference").deflection
        inside = sm.assembly_wrenches(machine, p).displacement
    with pytest.warns(DeprecationWarning, match="use its fields as keywords"):
        old = machine.solve(p, w, options=SolveOptions(gravity=(0, 0, -9.81))).displacement
    with pytest.warns(DeprecationWarning, match="use its fields as keywords"):
        drawn = sm.polar(machine, p, directions=3, options=SolveOptions(method="reference")).deflection
    with pytest.warns(DeprecationWarning, match="assembly_wrenches"):
        stress = sm.assembly_stress(machine, p).displacement
    assert (old == new).all() and (drawn == polar).all() and (stress == inside).all()
