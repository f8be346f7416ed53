"""One language: pages, messages, help texts and docstrings use the terms of docs/glossary.md."""

from __future__ import annotations

import re

import pytest
from tests.python.project.words import ABOUT_WORDS, INSTEAD, ROOT, found, pages, prose, strings

MODULES = sorted((ROOT / "python/stiffmap").rglob("*.py"))
MOST_TERMS, MOST_LINES = 60, 30


@pytest.mark.parametrize(
    "text", ["the readings tell three numbers", "a rest\nremains", "It is TOLD", "unfelt", "let go"]
)
def test_private_words_are_found(text: str) -> None:
    assert found(" ".join(text.split()))


@pytest.mark.parametrize("text", ["the readings show it", "the rest of the legs", "besides"])
def test_plain_words_are_not(text: str) -> None:
    assert not found(text)


def test_pages_use_the_terms_of_the_glossary() -> None:
    wrong = [
        f"{p.relative_to(ROOT)}:{n}: {word!r}"
        for p in pages()
        if str(p.relative_to(ROOT)) not in ABOUT_WORDS
        for n, line in enumerate(prose(p).splitlines(), 1)
        for word in found(line)
    ]
    assert not wrong, f"say instead {INSTEAD}: {wrong}"


def test_messages_help_and_docstrings_use_the_terms_of_the_glossary() -> None:
    wrong = [
        f"{p.relative_to(ROOT)}:{n}: {word!r}"
        for p in MODULES
        for n, text in strings(p)
        for word in found(" ".join(text.split()))
    ]
    assert not wrong, f"say instead {INSTEAD}: {wrong}"


def test_the_glossary_is_short_and_one_sentence_a_term() -> None:
    rows = re.findall(
        r"^\| \*\*(.+?) \|$", (ROOT / "docs/glossary.md").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert 30 < len(rows) <= MOST_TERMS
    for row in rows:
        term, meaning = row.split(" | ")
        assert meaning.count(". ") == 0 and 3 <= len(meaning.split()) <= 45, term


def test_releases_are_short_and_in_sections() -> None:
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    for release in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        title = release.splitlines()[0]
        sections = re.findall(r"^### (.+)$", release, re.MULTILINE)
        assert set(sections) <= {"Added", "Changed", "Deprecated", "Fixed"}, f"{title}: {sections}"
        assert sections, f"{title} has no sections"
        lines = [x for x in release.splitlines()[1:] if x.strip() and not x.startswith("#")]
        assert len(lines) <= MOST_LINES, f"{title}: {len(lines)} lines"
        assert all(len(x) <= 300 for x in lines), f"{title}: one line is a paragraph"


@pytest.mark.parametrize("page", ["tutorial.md", "tutorial_diagnosis.md"])
def test_tutorials_open_with_what_one_has_at_the_end(page: str) -> None:
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    first = text.split("\n\n")[1]
    assert re.match(r"At the end (of this page )?you have ", first), f"{page}: {first[:60]!r}"
