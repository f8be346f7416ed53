"""Every public name is documented: a docstring with shapes and units, and a place in the API page."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import stiffmap as sm
from stiffmap.solve import options
from stiffmap.solve.compiled import Flag, Status

ROOT = Path(__file__).parents[3]
API = (ROOT / "docs/api.md").read_text(encoding="utf-8")
NAMES = [n for n in sm.__all__ if n != "__version__"]
SHAPE = re.compile(r"\((?:\.\.\.|[a-z]|\d|poses)[^)]*\)|[Dd]imensions?\b|number of")
UNIT = re.compile(r"(?<!\w)(m|rad|N|N·m|SI|kg)(?!\w)|Status|Flag|where|which|[Nn]umber|rows|1 where|share")
ARRAYS = ("Floats", "ArrayLike", "NDArray", "Dataset", "DataArray")


def members(name: str) -> Iterator[tuple[str, Any]]:
    """Documented functions behind a public name: itself, or the methods and properties of a class."""
    value = getattr(sm, name)
    if not inspect.isclass(value):
        yield name, value
        return
    for key, member in vars(value).items():
        function = member.fget if isinstance(member, property) else member
        if not key.startswith("_") and inspect.isfunction(function):
            yield f"{name}.{key}", function


EVERY = [pair for name in NAMES for pair in members(name)]


@pytest.mark.parametrize("name", NAMES)
def test_name_has_a_docstring_and_stands_in_the_api_page(name: str) -> None:
    assert (getattr(sm, name).__doc__ or "").strip(), name
    assert re.search(rf"^::: stiffmap\.(?:[\w.]*\.)?{name}$", API, re.MULTILINE), f"docs/api.md lacks {name}"


def test_the_api_page_names_what_exists() -> None:
    for module, name in re.findall(r"^::: (stiffmap[\w.]*)\.(\w+)$", API, re.MULTILINE):
        assert hasattr(__import__(module, fromlist=[name]), name), f"{module}.{name}"


@pytest.mark.parametrize(("name", "function"), EVERY, ids=[n for n, _ in EVERY])
def test_docstrings_say_shapes_and_units(name: str, function: Any) -> None:
    text = function.__doc__ or ""
    assert text.strip(), f"{name} has no docstring"
    if any(a in str(function.__annotations__) for a in ARRAYS):
        assert SHAPE.search(text), f"{name} says no shape: {text!r}"
        assert UNIT.search(text), f"{name} says no unit: {text!r}"


def test_pages_are_in_reach_of_the_index() -> None:
    index = (ROOT / "docs/index.md").read_text(encoding="utf-8")
    pages = {p.name for p in (ROOT / "docs").glob("*.md")} - {"index.md"}
    assert {p for p in pages if f"]({p})" not in index} == set()


def enum_of(header: str, name: str) -> dict[str, int]:
    """Values of a C++ enumeration, counted where they are not said."""
    body = re.search(rf"enum class {name}[^{{]*{{(.*?)}};", header, re.DOTALL)
    assert body is not None, name
    out, following = {}, 0
    for entry in re.sub(r"//[^\n]*", "", body[1]).split(","):
        if entry.strip():
            key, _, said = (part.strip() for part in entry.partition("="))
            out[key.upper()] = following = int(said) if said else following
            following += 1
    return out


def test_values_agree_with_the_core() -> None:
    """What Python names by position is what the headers say."""
    folder = ROOT / "cpp/include/stiffmap"
    text = {p.stem: p.read_text(encoding="utf-8") for p in folder.rglob("*.hpp")}
    from stiffmap.solve.compiled import Role
    from stiffmap.solve.compiled.machine import LOAD_TYPES, PATH_CONTROLS
    from stiffmap.workspace.maps.sweep_line import ENDS

    assert enum_of(text["types"], "Status") == {s.name: s.value for s in Status}
    assert enum_of(text["mechanism"], "Role") == {r.name: r.value for r in Role}
    assert enum_of(text["load"], "LoadType") == {k.upper(): v for k, v in LOAD_TYPES.items()}
    assert list(enum_of(text["follower"], "PathControl")) == [c.upper() for c in PATH_CONTROLS]
    assert len(enum_of(text["path"], "PathEnd")) == len(ENDS)
    bits = re.findall(r"uint32_t (\w+) = 1u << (\d+)", "".join(text.values()))
    assert {name.upper(): 1 << int(bit) for name, bit in bits} == {f.name: f.value for f in Flag}


def test_keywords_are_the_fields_of_the_options() -> None:
    fields = set(options.SolveOptions.__dataclass_fields__)
    assert set(options.SolveKeywords.__annotations__) | set(options.LoadingKeywords.__annotations__) == fields


def test_no_test_file_lacks_an_assertion() -> None:
    claims = re.compile(r"\bassert\b|pytest\.(raises|fail)|assert_\w+\(|BOOST_(TEST|CHECK|REQUIRE)")
    files = [*(ROOT / "tests").rglob("test_*.py"), *(ROOT / "tests/cpp").glob("test_*.cpp")]
    assert files and [p.name for p in files if not claims.search(p.read_text(encoding="utf-8"))] == []


def test_every_line_of_the_slow_list_is_a_test() -> None:
    lines = (ROOT / "tests/python" / "slow.txt").read_text(encoding="utf-8").splitlines()
    gone = []
    for line in (x.split("#")[0].strip() for x in lines):
        if not line:
            continue
        file, name = line.split("::", 1)
        if not re.search(
            rf"def {name.split('[')[0]}\(", (ROOT / "tests/python" / file).read_text(encoding="utf-8")
        ):
            gone.append(line)
    assert not gone, f"slow.txt names tests that are not there: {gone}"


# Arguments that public calls share: what they are called, in the order in which they follow each other.
ORDER = ("machine", "experiment", "position", "wrench", "rotation")
SYNONYMS = {  # a name that a call must not use: the one that means it everywhere
    "pose": "position",
    "poses_at": "position",
    "load": "wrench",
    "forces_and_moments": "wrench",
    "n_threads": "threads",
    "jobs": "threads",
    "random_state": "seed",
    "verbose": "progress",
}
OPEN = {"Machine.with_effect"}
"""Takes the parameters of whatever effect is named."""
OTHERWISE = {"plan": {"load"}}
"""The wrench at a workpiece, beside `force` of the readings."""


def functions() -> list[tuple[str, Any]]:
    return [
        (name, f)
        for name, f in EVERY
        if not isinstance(
            inspect.getattr_static(getattr(sm, name.split(".")[0]), name.split(".")[-1], None), property
        )
        and inspect.isfunction(f)
    ]


@pytest.mark.parametrize(("name", "function"), functions(), ids=[n for n, _ in functions()])
def test_signatures_are_explicit_and_alike(name: str, function: Any) -> None:
    """`help` shows every argument by its name; shared ones are called alike, in one order."""
    parameters = inspect.signature(function).parameters
    kinds = {p.kind for p in parameters.values()}
    open_ended = {inspect.Parameter.VAR_KEYWORD, inspect.Parameter.VAR_POSITIONAL}
    assert name in OPEN or not kinds & open_ended, f"{name}{inspect.signature(function)}"
    wrong = set(parameters) & set(SYNONYMS) - OTHERWISE.get(name, set())
    assert not wrong, {w: SYNONYMS[w] for w in wrong}
    positional = [n for n, p in parameters.items() if p.kind is inspect.Parameter.POSITIONAL_OR_KEYWORD]
    shared = [n for n in positional if n in ORDER]
    assert shared == sorted(shared, key=ORDER.index), f"{name}: {shared}"
    assert all(p.annotation is not inspect.Parameter.empty for n, p in parameters.items() if n != "self"), (
        name
    )


def test_keywords_that_are_handed_on_are_shown() -> None:
    solve = inspect.signature(sm.Machine.solve).parameters
    assert set(options.SolveOptions.__dataclass_fields__) <= set(solve)
    assert solve["point"].default == "tcp" and solve["threads"].default is None
    assert "tolerance" in inspect.signature(sm.map_statistics).parameters


def test_results_show_themselves_in_one_line() -> None:
    machine = sm.load_machine("orthoglide-revised")
    s = machine.solve([[0, 0, 0], [9, 9, 9]], [100, 0, 0, 0, 0, 0])
    found = [machine, s, sm.inverse_kinematics(machine, [0, 0, 0]), sm.natural_frequencies(machine, [0, 0, 0]),
             machine.wrench([0, 0, 0], [1e-5, 0, 0, 0, 0, 0]), sm.velocity_transmission(machine, [0, 0, 0]),
             sm.deflection_budget(machine, [0, 0, 0], [100, 0, 0, 0, 0, 0])]  # fmt: skip
    for one in found:
        assert len(repr(one)) < 300 and "\n" not in repr(one), repr(one)
    assert repr(s).startswith("<Solution at tcp: 1 CONVERGED, 1 UNREACHABLE")
