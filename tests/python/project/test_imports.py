"""The Python tree: imports point one way, without a circle, and one package alone knows the compiled core.

Imports inside functions and under TYPE_CHECKING count as well.
"""

from __future__ import annotations

import ast
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[3] / "python/stiffmap"

# Eight rooms, from what knows no robot to what a person sees. Each may import from itself and from earlier ones only.
RANKS = (
    ("_core",),
    ("common",),
    ("model",),
    ("solve",),
    ("workspace",),
    ("experiment",),
    ("identification",),
    ("machining",),
    ("ui",),
)
# Rooms inside a room, each may import earlier ones only.
INNER = {
    "identification.diagnosis": (
        "clock",
        "candidates",
        "fitting",
        "search",
        ("rivals", "decision", "slips"),
        "report",
        "verdict",
    ),
    "experiment": (
        ("experiment", "channels", "notebook", "ramps", "setups"),
        "readings",
        "poses",
        "noise",
        "prediction",
        "comparison",
        "virtual",
        "files",
        "calls",
        "spreadsheet",
    ),
}
RANK = {name: i for i, names in enumerate(RANKS) for name in names}
TOP = {"stiffmap", "stiffmap.__main__"}  # the shop window: it names what lies in all rooms


def module_name(path: Path) -> str:
    parts = ("stiffmap", *path.relative_to(PACKAGE).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(p): p for p in sorted(PACKAGE.rglob("*.py"))}


def imported(path: Path) -> set[str]:
    """Modules of stiffmap that a file imports, wherever in it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "stiffmap":
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                found.add(inner if inner in MODULES or alias.name == "_core" else node.module)
        elif isinstance(node, ast.Import):
            found |= {a.name for a in node.names if a.name.split(".")[0] == "stiffmap"}
    return found


GRAPH = {name: imported(path) - {name} for name, path in MODULES.items()}


def room(module: str) -> str:
    """First part below stiffmap."""
    return module.split(".")[1] if "." in module else ""


def test_no_circle() -> None:
    sys.setrecursionlimit(max(sys.getrecursionlimit(), 5000))
    try:
        tuple(TopologicalSorter(GRAPH).static_order())
    except CycleError as circle:
        pytest.fail(" -> ".join(circle.args[1]))


def test_imports_lead_to_earlier_ranks() -> None:
    wrong = []
    for name, targets in GRAPH.items():
        for target in targets - TOP:
            here, there = room(name), room(target)
            if here in RANK and here != there and RANK.get(there, len(RANKS)) >= RANK[here]:
                wrong.append(f"{name} imports {target}")
    assert wrong == []


@pytest.mark.parametrize("outer", INNER)
def test_rooms_inside_a_room_have_an_order(outer: str) -> None:
    places = [(names,) if isinstance(names, str) else names for names in INNER[outer]]
    rank = {name: i for i, names in enumerate(places) for name in names}
    here = f"stiffmap.{outer}."
    inside = {m.removeprefix(here).split(".")[0] for m in MODULES if m.startswith(here)}
    assert inside == set(rank)
    wrong = []
    for name, targets in GRAPH.items():
        for target in (t for t in targets if t.startswith(here) and name.startswith(here)):
            own, other = (n.removeprefix(here).split(".")[0] for n in (name, target))
            if own != other and rank[other] > rank[own]:
                wrong.append(f"{name} imports {target}")
    assert wrong == []


def test_ranked_rooms_are_there() -> None:
    assert set(RANK) - {"_core"} == {room(m) for m in MODULES} - {"", "__main__"}


def test_only_commands_use_the_shop_window() -> None:
    users = {n for n, targets in GRAPH.items() if "stiffmap" in targets}
    assert {n for n in users if room(n) not in ("ui", "__main__")} == set()


def test_one_package_imports_the_core() -> None:
    users = {n for n, targets in GRAPH.items() if any("_core" in t.split(".") for t in targets)}
    assert users and all(n.startswith("stiffmap.solve.compiled.") for n in users)


def test_no_module_of_ours_is_imported_by_its_name_as_text() -> None:
    """What a string imports no reader and no test sees; the two tables of lazy names are the exception."""
    users = []
    for name, path in MODULES.items():
        text = path.read_text(encoding="utf-8")
        strings = {n.value for n in ast.walk(ast.parse(text)) if isinstance(n, ast.Constant)}
        if any(isinstance(s, str) and s in MODULES and s != "stiffmap" for s in strings):
            users.append(name)
    assert set(users) <= {"stiffmap", "stiffmap.ui.cli.commands"}


def test_the_count_sees_every_kind_of_import(tmp_path: Path) -> None:
    """The reader of imports itself: at the top, inside a function, under TYPE_CHECKING, of a name, of a module."""
    sample = tmp_path / "sample.py"
    sample.write_text(
        "from stiffmap import _core\nimport stiffmap.workspace.maps\nif TYPE_CHECKING:\n    from stiffmap.solve.machine import Machine\n"
        "def f():\n    from stiffmap.workspace.maps import block\n"
    )
    assert imported(sample) == {
        "stiffmap._core",
        "stiffmap.workspace.maps",
        "stiffmap.solve.machine",
        "stiffmap.workspace.maps.block",
    }
