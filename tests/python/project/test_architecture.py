"""Dependencies point one way, and each kind of line has its room (CONTRIBUTING.md)."""

from __future__ import annotations

import re
from collections import Counter
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
HEADERS = sorted((ROOT / "cpp/include/stiffmap").glob("*.hpp"))

# A header may include headers of earlier ranks only.
RANKS = (
    ("types", "check", "parallel", "kept_memory"),
    ("dense", "se3", "answers"),
    ("law", "spring", "load", "chatter"),
    ("chain",),
    ("whole_branches",),
    ("mechanism",),
    ("charts",),
    ("kinematics",),
    ("pull",),
    ("closure", "linearization", "rigid_tree"),
    ("saddle", "home", "floating", "free_spins", "motion", "pose_closer", "redundancy"),
    ("stability", "home_record"),
    ("equilibrium", "stiffness", "dynamics", "enclosure"),
    ("spins",),
    ("assemble", "solve", "fast_plan"),
    ("batch", "clamp", "follower", "modes"),
    ("path",),
    ("poses",),
)
RANK = {name: i for i, names in enumerate(RANKS) for name in names}


def text(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def code(path: Path) -> str:
    """C++ without its comments and strings."""
    plain = re.sub(r"//[^\n]*|/\*.*?\*/", "", text(path), flags=re.S)
    return re.sub(r'"(\\.|[^"\\])*"', '""', plain)


def included(path: Path) -> list[str]:
    return re.findall(r'#include "stiffmap/(\w+)\.hpp"', text(path))


def core_files() -> list[Path]:
    return sorted(p for p in (ROOT / "cpp").rglob("*") if p.suffix in (".hpp", ".cpp"))


def test_every_header_has_a_rank() -> None:
    assert {h.stem for h in HEADERS} == set(RANK)


@pytest.mark.parametrize("header", HEADERS, ids=lambda p: p.stem)
def test_headers_include_earlier_ranks_only(header: Path) -> None:
    for name in included(header):
        assert RANK[name] < RANK[header.stem], f"{header.name} must not include {name}.hpp"


def test_sources_include_no_later_rank() -> None:
    for source in sorted((ROOT / "cpp/src").glob("*.cpp")):
        for name in included(source):
            assert RANK[name] <= RANK[source.stem], f"{source.name} must not include {name}.hpp"


def plain_includes(path: Path) -> list[Path]:
    """Files of the core that a file includes, by either way to name them."""
    folders = (path.parent, ROOT / "cpp/include")
    found = re.findall(r'#include "([^"]+)"', text(path))
    return [next(p for f in folders if (p := (f / name).resolve()).exists()) for name in found]


def test_no_circle_of_includes_in_any_folder() -> None:
    graph = {p.resolve(): plain_includes(p) for p in core_files()}
    tuple(TopologicalSorter(graph).static_order())  # CycleError names the circle


def test_sub_folders_stand_below_what_uses_them() -> None:
    """Plans are built from the headers that `fast_plan` may use; of the kernels others see the program and the table."""
    for source in core_files():
        folder, targets = source.parent.name, plain_includes(source)
        if folder == "plan":
            ranks = [RANK[name] for name in included(source)]
            assert all(r <= RANK["fast_plan"] for r in ranks), source.name
        if folder == "kernels":
            assert set(included(source)) <= {"check"}, source.name
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
