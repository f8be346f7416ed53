"""The Python tree: imports point one way, without a circle, and one package alone knows the compiled core.

Imports inside functions and under TYPE_CHECKING count as well.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from importlib import import_module
from pathlib import Path

import pytest

from stiffmap.common.from_above import PLACES

PACKAGE = Path(__file__).parents[3] / "python/stiffmap"

# From what knows no robot to what a person sees. Each room imports from itself and from earlier ones only.
ROOMS = ("common", "model", "solve", "workspace", "experiment", "identification", "machining", "ui")
# Packages inside a room or a package, each may import earlier ones only.
INNER = {
    "identification": (
        ("clock", "validity", "candidates", "numbers"),
        "inference",
        ("calibration", "diagnosis"),
        "planning",
        "taps",
    ),
    "identification.inference": (
        "constants",
        ("kernels", "places", "optimum"),
        "travel",
        "columns",
        "parts",
        "amplitudes",
        "chosen",
        "world",
        "several",
        ("names", "shares"),
        ("verdict", "readings"),
        "corrected",
        "machines",
    ),
    "identification.diagnosis": ("slips", "report", "answer", "stages"),
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
RANK = {name: i for i, name in enumerate(("_core", *ROOMS))}
FACE = {"stiffmap", "stiffmap.__main__"}  # names what lies in all rooms
# Who may load a module by a name that is computed, and what: no reader and no other test sees such an import.
BY_NAME = {
    "stiffmap.common.public",  # public names, when they are first used; `imported` reads their stubs
    "stiffmap.common.from_above",  # the two methods that hand their work to a room above, as the face of the package says
    "stiffmap.common.python_file",  # files of one folder, and a file that a user wrote
    "stiffmap.ui.cli.commands",  # the module of a command, and what it imports when it runs
}
LOADERS = {
    "import_module",
    "__import__",
    "exec_module",
    "load_module",
    "run_module",
    "run_path",
    "resolve_name",
}


def module_name(path: Path) -> str:
    parts = ("stiffmap", *path.relative_to(PACKAGE).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(p): p for p in sorted(PACKAGE.rglob("*.py"))}


def statements(block: list[ast.stmt]) -> Iterator[ast.stmt]:
    """Every statement of a block, wherever in it, without what it computes."""
    for node in block:
        yield node
        for name in ("body", "orelse", "finalbody", "handlers", "cases"):
            yield from statements(getattr(node, name, []))


def imported(path: Path) -> set[str]:
    """Modules of stiffmap that a file imports, wherever in it; of a package also those from which its stub has its names."""
    found, stub = set(), path.with_suffix(".pyi")
    text = path.read_text(encoding="utf-8") + (stub.read_text(encoding="utf-8") if stub.exists() else "")
    for node in statements(ast.parse(text).body):
        module = getattr(node, "module", None) or ""
        if getattr(node, "level", 0):  # of a stub
            module = f"{module_name(path)}.{module}".rstrip(".")
        if isinstance(node, ast.ImportFrom) and module.split(".")[0] == "stiffmap":
            for alias in node.names:
                inner = f"{module}.{alias.name}"
                found.add(inner if inner in MODULES or alias.name == "_core" else module)
        elif isinstance(node, ast.Import):
            found |= {a.name for a in node.names if a.name.split(".")[0] == "stiffmap"}
    return found


@cache
def graph() -> dict[str, set[str]]:
    """What each module imports; read when a test asks, which takes a second."""
    return {name: imported(path) - {name} for name, path in MODULES.items()}


def room(module: str) -> str:
    """First part below stiffmap."""
    return module.split(".")[1] if "." in module else ""


def test_no_circle() -> None:
    sys.setrecursionlimit(max(sys.getrecursionlimit(), 5000))
    try:
        tuple(TopologicalSorter(graph()).static_order())
    except CycleError as circle:
        pytest.fail(" -> ".join(circle.args[1]))


def test_imports_lead_to_earlier_ranks() -> None:
    wrong = []
    for name, targets in graph().items():
        for target in targets - FACE:
            if name not in FACE and RANK[room(target)] > RANK[room(name)]:
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
    for name, targets in graph().items():
        for target in (t for t in targets if t.startswith(here) and name.startswith(here)):
            own, other = (n.removeprefix(here).split(".")[0] for n in (name, target))
            if own != other and rank[other] > rank[own]:
                wrong.append(f"{name} imports {target}")
    assert wrong == []


def test_only_commands_use_the_shop_window() -> None:
    users = {n for n, targets in graph().items() if "stiffmap" in targets}
    assert {n for n in users if room(n) != "ui"} - FACE == set()


def test_one_package_imports_the_core() -> None:
    users = {n for n, targets in graph().items() if any("_core" in t.split(".") for t in targets)}
    assert users and all(n.startswith("stiffmap.solve.compiled.") for n in users)


def loaders(path: Path) -> set[str]:
    """Functions that load a module by its name as text, under whatever name a file imports or mentions them."""
    found: set[str] = set()
    text = path.read_text(encoding="utf-8")
    if not any(word in text for word in (*LOADERS, "exec", "eval", "modules")):
        return found  # nothing to take apart, which is what takes time
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom):
            found |= {a.name for a in node.names} & LOADERS
        elif isinstance(node, ast.Attribute):
            found |= {node.attr} & LOADERS
            if node.attr == "modules" and ast.unparse(node) == "sys.modules":
                found.add("sys.modules")
        elif isinstance(node, ast.Name):
            found |= {node.id} & (LOADERS | {"exec", "eval"})
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            found |= {node.value} & LOADERS  # getattr(importlib, "import_module")
    return found


def test_modules_are_loaded_by_name_in_few_places() -> None:
    assert {name for name, path in MODULES.items() if loaders(path)} == BY_NAME


@pytest.mark.parametrize("folder", ["bench", "docs", "examples"])
def test_scripts_import_names_that_there_are(folder: str) -> None:
    absent = []
    for path in sorted((PACKAGE.parents[1] / folder).rglob("*.py")):
        for node in statements(ast.parse(path.read_text(encoding="utf-8")).body):
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "stiffmap":
                module = import_module(node.module)
                names = [a.name for a in node.names if f"{node.module}.{a.name}" not in MODULES]
                absent += [f"{path.name}: {node.module}.{n}" for n in names if not hasattr(module, n)]
    assert not absent


def test_no_module_of_ours_is_imported_by_its_name_as_text() -> None:
    """The tables of public names, of commands, and of what lies above."""
    users, ours = set(), MODULES.keys() - {"stiffmap"}
    rooms = tuple(f"stiffmap.{r}" for r in ROOMS)
    for name, path in MODULES.items():
        source = path.read_text(encoding="utf-8")
        if not re.search(r"[\"']stiffmap\.", source):
            continue
        for node in ast.walk(ast.parse(source)):
            text = node.value if isinstance(node, ast.Constant) else ""
            if isinstance(text, str) and (text in ours or text.startswith(rooms)):
                users.add(name)
    assert users == {"stiffmap", "stiffmap.ui.cli.commands"}


def test_two_methods_reach_up() -> None:
    """Whatever else asks for a room above is misplaced."""
    assert set(PLACES) == {"Machine.view", "Diagnosis.report"}
    users = {n for n, targets in graph().items() if "stiffmap.common.from_above" in targets} - {"stiffmap"}
    assert users == {"stiffmap.solve.machine", "stiffmap.identification.diagnosis.report.result"}


@pytest.mark.parametrize(
    "text",
    [
        "from importlib import import_module as get\nget(f'{__package__}.view')",
        "import importlib as i\ni.import_module('.ui', 'stiffmap')",
        "import importlib\ngetattr(importlib, 'import_module')('stiffmap' + '.ui')",
        "__import__('stiffmap.ui')",
        "import sys\nsys.modules['stiffmap' + '.ui']",
        "import pkgutil\npkgutil.resolve_name('stiffmap.ui:main')",
        "exec('import stiffmap.ui')",
    ],
)
def test_every_spelling_is_seen(text: str, tmp_path: Path) -> None:
    (tmp_path / "sample.py").write_text(text)
    assert loaders(tmp_path / "sample.py")


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
