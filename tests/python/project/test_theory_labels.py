"""Code cites docs/theory.md by labels that exist there, and the page names tests that exist."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[3]
THEORY = (ROOT / "docs/theory.md").read_text(encoding="utf-8")
CITATION = re.compile(r"theory(?:\.md)?\)?,?\s+\(?([A-Z]\d+(?:(?:-|, | and | to )[A-Z]\d+)*)")
DEFINITION = re.compile(r"(?m)^(?:\| (?=[A-Z]\d+ \|)|\*\*)([A-Z]\d+)(?=[ .,*])")


def defined() -> set[str]:
    return set(DEFINITION.findall(THEORY))


def cited() -> dict[str, str]:
    found = {}
    for folder in ("cpp", "python", "docs", "tests", "bench"):
        for path in (ROOT / folder).rglob("*"):
            if path.suffix not in (".hpp", ".cpp", ".py", ".md"):
                continue
            for group in CITATION.findall(path.read_text(encoding="utf-8")):
                for label in re.split(r"-|, | and | to ", group):
                    found[label] = path.name
    return found


def test_cited_labels_are_defined() -> None:
    labels = cited()
    assert len(labels) > 25
    assert {k: v for k, v in labels.items() if k not in defined()} == {}


def test_a_label_is_given_once() -> None:
    labels = DEFINITION.findall(THEORY)
    assert len(labels) > 75
    assert (
        DEFINITION.findall("**M1.** a\n**M1, b.** a\n**M1** [25]. a\n| M1 | a |\n**note** a\n") == ["M1"] * 4
    )
    assert [k for k in labels if labels.count(k) > 1] == []


def test_named_checks_exist() -> None:
    sources = [p for p in (ROOT / "tests").rglob("*") if p.suffix in (".py", ".cpp")]
    for name in re.findall(r"`(?:tests/\S*/)?(test_\w+\.(?:py|cpp))`", THEORY):
        assert name in {p.name for p in sources}, name
    everything = "\n".join(p.read_text(encoding="utf-8") for p in sources)
    for table in re.findall(r"(?m)^\| R\d+ \|.*\| (.*) \|$", THEORY):
        for case in re.findall(r"\b[a-z]+(?:_[a-z]+){2,}\b", table):
            assert case in everything, case
    for note in re.findall(r"\(`test_\w+\.(?:cpp|py)`[: ]([^)]*)\)", THEORY):
        for case in re.findall(r"\b[a-z]+(?:_[a-zA-Z]+){2,}\b", note):
            assert case in everything, case
