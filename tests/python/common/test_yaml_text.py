"""YAML is read by libyaml where it reads as PyYAML does, and by PyYAML where not: one answer, whichever is there."""

from __future__ import annotations

import pytest

from stiffmap.common import yaml_text
from stiffmap.common.errors import FileError
from stiffmap.model.files.shipped import machine_folder, machine_names

KINDS = """# all kinds of values
numbers: [1, -1e6, .5, 0x1, 1_0, -.inf, ~, true, no, 12:30]
texts: {plain: a b, 'single': it''s, "double": "\\u00e4 \\n", empty: }
anchors: [&a {b: 1}, *a, {<<: *a, c: 2}]
blocks:
  - |
    two
    lines
  - >-
    folded
    text
"""


@pytest.mark.parametrize("name", ["kinds", *machine_names()])
def test_both_readers_read_the_same(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    path = machine_folder() / f"{name}.yaml"
    text = KINDS if name == "kinds" else path.read_text(encoding="utf-8")
    read = yaml_text.parse(text)
    monkeypatch.setattr(yaml_text, "_Fast", yaml_text._Loader)
    slow = yaml_text.parse(text)
    assert repr(read) == repr(slow) and read.lines[("numbers" if name == "kinds" else "name",)] > 0


@pytest.mark.parametrize(
    "text", ["a:\t1", "{a?b: 1, c? : 2}", "%YAML 1.2\n---\na: 1", "a: 1\n!", "a: \ufeff1"]
)
def test_what_libyaml_reads_otherwise_is_as_pyyaml_reads_it(
    text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def answer() -> object:
        try:
            return yaml_text.parse(text)
        except FileError as error:
            return str(error)

    read = answer()
    monkeypatch.setattr(yaml_text, "_Fast", yaml_text._Loader)
    assert read == answer()


MERGED = """first: &first {E: 1, nu: 2}
other: &other {E: 3, nu: 4, rho: 5}
both: {<<: [*first, *other], E: 6}
turned:
  <<: [*other, *first]
inside: {<<: {<<: *other, nu: 7}}
"""


def test_of_merged_mappings_the_first_with_a_key_counts() -> None:
    data = yaml_text.parse(MERGED).data
    assert data["both"] == {"E": 6, "nu": 2, "rho": 5}
    assert data["turned"] == data["other"]
    assert data["inside"] == {"E": 3, "nu": 7, "rho": 5}


@pytest.mark.parametrize("text", ["{<<: *first, <<: *other}", "{<<: 3}", "{<<: [*first, E]}", "{<<: }"])
def test_what_cannot_be_merged_is_refused(text: str) -> None:
    with pytest.raises(FileError, match="line 7: expected '<<' once, with a mapping or a list of them"):
        yaml_text.parse(f"{MERGED}bad: {text}\n")
    with pytest.raises(FileError, match="line 1: an anchor contains itself"):
        yaml_text.parse("a: &a {<<: *a}")
