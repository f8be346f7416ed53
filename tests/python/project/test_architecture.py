"""Dependencies point one way, and each kind of line has its room (CONTRIBUTING.md)."""

from __future__ import annotations

import re
from collections import Counter
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
HEADERS = sorted((ROOT / "cpp/include/stiffmap").rglob("*.hpp"))

# Folders of `cpp/include/stiffmap` and of `cpp/src`: a file may include headers of its own folder and of earlier ones.
FOLDERS = (
    "algebra",
    "common",
    "model",
    "kinematics",
    "closure",
    "stiffness",
    "equilibrium",
    "plan",
    "solve",
    "machining",
)


def text(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def code(path: Path) -> str:
    """C++ without its comments and strings."""
    plain = re.sub(r"//[^\n]*|/\*.*?\*/", "", text(path), flags=re.S)
    return re.sub(r'"(\\.|[^"\\])*"', '""', plain)


def core_files() -> list[Path]:
    return sorted(p for p in (ROOT / "cpp").rglob("*") if p.suffix in (".hpp", ".cpp"))


def plain_includes(path: Path) -> list[Path]:
    """Files of the core that a file includes, by either way to name them."""
    folders = (path.parent, ROOT / "cpp/include")
    found = re.findall(r'#include "([^"]+)"', text(path))
    return [next(p for f in folders if (p := (f / name).resolve()).exists()) for name in found]


def test_no_circle_of_includes_in_any_folder() -> None:
    graph = {p.resolve(): plain_includes(p) for p in core_files()}
    tuple(TopologicalSorter(graph).static_order())  # CycleError names the circle


def test_a_header_lies_in_a_folder_and_its_source_in_the_one_of_the_same_name() -> None:
    include, src = ROOT / "cpp/include/stiffmap", ROOT / "cpp/src"
    assert {p.parent for p in HEADERS} == {include / f for f in FOLDERS}
    assert {p.parent for p in src.rglob("*.[ch]pp")} == {src / f for f in FOLDERS if f != "common"}
    folder = {h.stem: h.parent.name for h in HEADERS}
    assert len(folder) == len(HEADERS)


@pytest.mark.parametrize("folder", FOLDERS)
def test_a_folder_includes_earlier_ones_only(folder: str) -> None:
    allowed = {*FOLDERS[: FOLDERS.index(folder) + 1], "kernels"}
    if folder == "machining":  # it knows no machine of ours
        allowed = {"algebra", "common", folder}
    files = [p for p in core_files() if p.parent.name == folder]
    found = {p.name: {t.parent.name for t in plain_includes(p)} for p in files}
    assert {name: folders - allowed for name, folders in found.items() if folders - allowed} == {}


def test_kernels_know_the_refusal_only_and_show_the_program_and_the_table() -> None:
    for source in core_files():
        targets = plain_includes(source)
        if source.parent.name == "kernels":
            assert {t.name for t in targets if t.parent.name != "kernels"} <= {"check.hpp"}, source.name
        else:
            used = {t.name for t in targets if t.parent.name == "kernels"}
            assert used <= {"program.hpp", "dispatch.hpp"}, f"{source.name}: {used}"


def test_threads_only_in_parallel() -> None:
    pattern = re.compile(r"<(thread|mutex|atomic|future|condition_variable)>|std::(j?thread|mutex|atomic)\b")
    found = [p.name for p in core_files() if pattern.search(text(p))]
    assert found == ["parallel.hpp"]


def test_the_core_knows_no_python_no_clock_and_no_millimetre() -> None:
    words = re.compile(
        r"pybind11|Python\.h|<chrono>|<ctime>|clock_gettime|\bmm\b|millimet|<fstream>|<iostream>"
    )
    assert {p.name: words.search(code(p)) for p in core_files() if words.search(code(p))} == {}


def test_instruction_sets_only_in_kernels() -> None:
    words = re.compile(r"immintrin|__builtin_cpu|vector_size|-march")
    found = {p.parent.name for p in core_files() if words.search(code(p))}
    assert found <= {"kernels"}


def test_kernels_use_no_eigen() -> None:
    """Eigen compiled for different instruction sets must not meet in one process (docs/fast_path.md)."""
    levels = [p for p in (ROOT / "cpp/kernels").iterdir() if p.stem != "dispatch"]
    assert levels
    assert [p.name for p in levels if re.search(r"Eigen", code(p))] == []


PLAIN = ("from stiffmap.model.description", "from stiffmap.common.units", "from stiffmap.common.number_text")


def test_the_description_computes_nothing() -> None:
    """Descriptions are plain data: no compiled core, no files, no numerics beyond NumPy."""
    for path in (ROOT / "python/stiffmap/model/description").glob("*.py"):
        for line in text(path).splitlines():
            if line.startswith(("import stiffmap", "from stiffmap")):
                assert line.startswith(PLAIN), f"{path.name}: {line}"
            assert not re.match(r"(from|import) (scipy|yaml|pydantic|xarray)", line), f"{path.name}: {line}"


def test_bindings_hand_arrays_over_and_decide_nothing() -> None:
    """What is answered at which pose is the core's: no loop over poses, no status and no flag at the border."""
    words = re.compile(r"parallel_chunks|Status::|flag::|\bcontinue\b")
    files = sorted((ROOT / "python/bindings").glob("*.[ch]pp"))
    assert files
    assert {p.name: words.search(code(p)) for p in files if words.search(code(p))} == {}


def test_a_class_has_a_name_of_its_own() -> None:
    found = re.findall(
        r"^class ([A-Z]\w*)", "\n".join(map(text, (ROOT / "python/stiffmap").rglob("*.py"))), re.MULTILINE
    )
    assert not [name for name, times in Counter(found).items() if times > 1]
