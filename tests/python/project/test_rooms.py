"""The house: eight rooms and nothing beside them, a table that names every package, tests that mirror them."""

from __future__ import annotations

import ast
import re
from itertools import pairwise
from pathlib import Path

import pytest
from tests.python.project.test_imports import MODULES, PACKAGE, ROOMS, graph, imported

ROOT = Path(__file__).parents[3]
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
PARSED = {"startswith", "endswith", "removeprefix", "removesuffix", "partition", "rpartition", "split", "rsplit", "index",
          "rindex", "find", "rfind"}  # fmt: skip
FORMATS = {"stiffmap.model.link.readers"}  # columns of other programs' files begin with blanks


def test_the_root_holds_the_rooms_and_the_face() -> None:
    found = {p.name for p in PACKAGE.iterdir() if p.name != "__pycache__" and p.suffix != ".so"}
    assert found == {*ROOMS, "__init__.py", "__init__.pyi", "__main__.py", "_core.pyi", "py.typed"}


def test_ranked_rooms_are_there() -> None:
    assert {m.split(".")[1] for m in MODULES if "." in m} == {*ROOMS, "__main__"}
    assert {p.parent.name for p in PACKAGE.glob("*/__init__.py")} == set(ROOMS)


def test_the_table_of_rooms_is_whole() -> None:
    """A room and a package of a room have a row in CONTRIBUTING, and nothing else has."""
    packages = {
        ".".join(p.parent.relative_to(PACKAGE).parts)
        for pattern in ("*/__init__.py", "*/*/__init__.py")
        for p in PACKAGE.glob(pattern)
    }
    rows = re.search(r"(?s)\n## Eight rooms\n(.*?)\n## ", CONTRIBUTING)
    assert rows and set(re.findall(r"(?m)^\| `([a-z_.]+)` \|", rows[1])) == packages


def test_tests_lie_as_what_they_test() -> None:
    """tests/python/<room>/<package>; what tests no room is in `project`."""
    tests = ROOT / "tests/python"
    folders = {p.parent.relative_to(tests) for p in tests.rglob("test_*.py")}
    rest = {f for f in folders if f.parts[0] != "project"}
    assert {f.parts[0] for f in rest} == set(ROOMS)
    assert [f for f in rest if not (PACKAGE / f).is_dir()] == []


def parsed_back(path: Path) -> list[str]:
    """Where a text of several words, or one that is put together so, is taken apart or searched for."""
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in PARSED:
            sought: list[ast.expr] = node.args[:1]
        elif isinstance(node, ast.Compare) and isinstance(node.ops[0], ast.In | ast.NotIn):
            sought = [node.left]
        else:
            continue
        texts = [c.value for a in sought for c in ast.walk(a) if isinstance(c, ast.Constant)]
        if any(isinstance(t, str) and t.strip() and re.search(r"\s", t) for t in texts):
            found.append(f"{path.name}:{node.lineno}: {ast.unparse(node)}")
    return found


def test_sentences_are_not_parsed_back() -> None:
    """Words are made for people; code that reads its own sentences breaks with every better word."""
    assert [w for name, path in MODULES.items() if name not in FORMATS for w in parsed_back(path)] == []


@pytest.mark.parametrize("text", ['name.startswith(f"{c}: ")', '"held out" in why', 'a.split(" of ")[0]'])
def test_a_sentence_that_is_parsed_back_is_seen(text: str, tmp_path: Path) -> None:
    (tmp_path / "sample.py").write_text(text)
    assert parsed_back(tmp_path / "sample.py")


# --- the way of a number ---------------------------------------------------------------------------------------------

WAYS = {
    title: re.findall(r"(?m)^\d+\. `([\w/.]+)`", body)
    for title, body in re.findall(r"(?ms)^### ([^\n]+)\n(.*?)(?=^##)", CONTRIBUTING)
}


def reached(module: str) -> set[str]:
    """What a module imports, through the packages and the face that hand it on."""
    found: set[str] = set()
    new = graph()[module]
    while new:
        found |= new
        handed_on = {m for m in new if m in MODULES and MODULES[m].name == "__init__.py"}
        new = {t for m in handed_on for t in graph()[m]} - found
    return found


def defined(path: Path) -> set[str]:
    """Names of functions and classes of a file."""
    nodes = ast.parse(path.read_text(encoding="utf-8")).body
    return {n.name for n in nodes if isinstance(n, ast.FunctionDef | ast.ClassDef)}


def headers(path: Path) -> set[str]:
    """Names of the headers that a C++ file includes, directly or through others."""
    there = [p for top in ("cpp/include", "cpp/src", "python/bindings") for p in (ROOT / top).rglob("*.hpp")]
    found: set[str] = set()
    new = [path]
    while new:
        names = (
            set(re.findall(r'#include "(?:\S*/)?(\w+\.hpp)"', new.pop().read_text(encoding="utf-8"))) - found
        )
        found |= names
        new += [p for p in there if p.name in names]
    return found


def leads_to(a: str, b: str) -> bool:
    """Whether file a imports file b and uses a name of it; a C++ file includes its header or is the compiled module."""
    first, second = ROOT / a, ROOT / b
    if second.suffix == ".cpp":
        python = first.suffix == ".py"
        return "stiffmap._core" in imported(first) if python else f"{second.stem}.hpp" in headers(first)
    if first.suffix == ".cpp":
        return False
    names = {path: name for name, path in MODULES.items()}
    words = set(re.findall(r"\w+", first.read_text(encoding="utf-8")))
    return names[second] in reached(names[first]) and bool(words & defined(second))


def test_there_are_three_ways() -> None:
    assert len(WAYS) == 3
    assert all(3 <= len(files) <= 12 for files in WAYS.values())


@pytest.mark.parametrize("way", WAYS)
def test_each_file_of_a_way_calls_the_next_or_is_called_by_it(way: str) -> None:
    files = [f if f.startswith(("cpp/", "python/")) else f"python/stiffmap/{f}" for f in WAYS[way]]
    assert [f for f in files if not (ROOT / f).is_file()] == []
    pairs = list(pairwise(files))
    assert [f"{a} - {b}" for a, b in pairs if not (leads_to(a, b) or leads_to(b, a))] == []
