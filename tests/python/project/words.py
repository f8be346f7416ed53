"""Prose that users and readers see, sentence by sentence: pages, messages, help texts and docstrings."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[3]
CODE = re.compile(r"```.*?```|``[^`]*``|`[^`\n]*`|\]\([^)]*\)|<[^>\n]*>", re.DOTALL)
ABOUT_WORDS = ("docs/glossary.md",)
"""The page that names the old words."""

INSTEAD = {
    r"told": "identifiable, determined, given, reported",
    r"(?:readings|rows|plan|slopes|kernels|step|predictions?) (?:can |cannot |do not )?tells?": "determine, identify",
    r"(?:un)?felt": "observable",
    r"beside": "next to, jointly with, in addition to, compared with",
    r"let go": "condensed; a prior is widened",
    r"(?:a|unexplained) rest": "residual, unexplained",
    r"struck|witness(?:es)?": "excluded, counterexample",
    r"claim(?:s)? (?:stands?|holds?)": "the hypothesis is accepted",
    r"knows? nothing of": "does not depend on, is independent of",
    r"travel profiles?": "axis positioning error (ISO 230)",
    r"asks? the drives": "a force needs drive efforts; positions are computed",
    r"nobody can tell": "it is unknown",
}
"""Private words as patterns, and the field's terms for them (docs/glossary.md)."""

BANNED = re.compile(r"\b(?:" + "|".join(INSTEAD) + r")\b", re.IGNORECASE)


def pages() -> list[Path]:
    """Written pages; `RESULTS.md` is a diary of measurements."""
    return [
        ROOT / "README.md",
        ROOT / "CHANGELOG.md",
        ROOT / "CONTRIBUTING.md",
        *sorted((ROOT / "docs").rglob("*.md")),
    ]


def prose(path: Path) -> str:
    """A page without its code; lines stay where they are."""
    return CODE.sub(lambda m: "\n" * m[0].count("\n"), path.read_text(encoding="utf-8"))


def strings(path: Path) -> Iterator[tuple[int, str]]:
    """Line and text of every string constant of a module: docstrings, messages, help."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
            yield node.lineno, CODE.sub("", node.value)


def found(text: str) -> list[str]:
    """Private words in a text."""
    return [m[0] for m in BANNED.finditer(text)]
