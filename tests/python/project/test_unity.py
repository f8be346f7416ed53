"""A wheel compiles several sources as one: names that files keep to themselves differ (CONTRIBUTING.md)."""

from __future__ import annotations

import re
from collections import defaultdict
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
OPENED, CLOSED = re.compile(r"namespace\s*\{"), re.compile(r"\}\s*//\s*namespace\s*$")
KEPT = re.compile(r"(?:(?:static )?(?:constexpr|const) [\w:<>]+|struct|class|enum class|enum) (\w+)")


def names_of(text: str) -> set[str]:
    """Constants and types at the outer level of anonymous namespaces; functions may be overloaded, aliases repeated."""
    found, inside = set(), False
    for line in text.splitlines():
        inside = (inside or bool(OPENED.match(line))) and not CLOSED.match(line)
        declared = KEPT.match(line) if inside else None
        if declared and not re.match(r"\w+\(", line[declared.start(1) :]):
            found.add(declared[1])
    return found - {"namespace"}


def shared_names(folder: Path) -> dict[str, list[str]]:
    """Names that several files of a folder keep to themselves."""
    files = defaultdict(list)
    for path in sorted(folder.rglob("*.cpp")):
        for name in names_of(path.read_text(encoding="utf-8")):
            files[name].append(path.relative_to(folder).as_posix())
    return {name: where for name, where in files.items() if len(where) > 1}


@pytest.mark.parametrize("folder", ["cpp/src", "python/bindings"])
def test_names_that_files_keep_to_themselves_differ(folder: str) -> None:
    assert any((ROOT / folder).rglob("*.cpp"))
    assert shared_names(ROOT / folder) == {}


def test_a_name_of_two_files_is_noticed(tmp_path: Path) -> None:
    for name, size in (("a", 1), ("b", 2)):
        (tmp_path / f"{name}.cpp").write_text(
            f"namespace {{\nconstexpr double least = {size};\nstruct Of{name} {{}};\nconst int f(int a) {{\n}}\n}}  // namespace\n"
        )
    assert shared_names(tmp_path) == {"least": ["a.cpp", "b.cpp"]}
