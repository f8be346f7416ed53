"""Files that nobody should write: read, or refused by one error (`python -m tests.python.project.fuzz.run` for many more)."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from tests.python.project.fuzz.run import attempt, one_input
from tests.python.project.fuzz.targets import TARGETS

import stiffmap as sm
from stiffmap.common.yaml_text import parse


@pytest.mark.parametrize("kind", TARGETS)
def test_mutated_files_are_read_or_refused(kind: str, tmp_path: Path) -> None:
    seeds = TARGETS[kind].seeds()
    ends = {s: attempt(TARGETS[kind], one_input(seeds, s), tmp_path / "in") for s in range(40)}
    assert {s: e for s, e in ends.items() if e not in ("read", "refused")} == {}
    assert set(ends.values()) == {"read", "refused"}  # the mutations are neither too mild nor too wild


@settings(max_examples=100, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.text(max_size=200))
def test_any_text_is_read_or_refused(text: str) -> None:
    ending = ""
    try:
        parse(text, "f.yaml")
    except sm.StiffmapError as error:
        ending = str(error)
    assert ending == "" or ending.startswith("f.yaml")


LAUGHS = "a: &a [x, x]\n" + "".join(
    f"b{i}: &b{i} [{', '.join(['*' + (f'b{i - 1}' if i else 'a')] * 9)}]\n" for i in range(12)
)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[" * 5000, "line 1: expected at most 60 levels"),
        ("a: " + "{b: " * 5000, "line 1: expected at most 60 levels"),
        ("a: [0, ? , " + "[ " * 6000, "line 1: expected at most 60 levels"),
        ("".join(f"{' ' * i}-\n" for i in range(3000)), "line 61: expected at most 60 levels"),
        (LAUGHS, "line 7: expected at most 500000 values with all anchors written out"),
        ("a: " + "9" * 5000, "at most 300 digits, found 5000"),
        ("a: !!float x", "could not convert"),
        ("a: !!binary aGk=", "expected plain data, found the tag"),
        ("a: !!python/object:os.system x", "tag"),
        ("a: \x00", "not valid YAML"),
    ],
)
def test_what_once_took_minutes_or_a_traceback(text: str, words: str) -> None:
    start = time.process_time()
    with pytest.raises(sm.StiffmapError) as error:
        parse(text, "f.yaml")
    assert words in str(error.value)
    assert len(str(error.value)) < 300
    assert time.process_time() - start < 5


def test_anchors_are_still_welcome() -> None:
    assert parse("a: &a {x: 1}\nb: *a\nc: {<<: *a, y: 2}").data["c"] == {"x": 1, "y": 2}
