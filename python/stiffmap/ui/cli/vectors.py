"""Vectors on the command line: ``--at -200,-200,-200`` and ``--at -200 -200 -200`` are the same."""

from __future__ import annotations

from collections.abc import Sequence

from stiffmap.common.number_text import number_in

VECTORS = frozenset(
    (
        "--at",
        "--force",
        "--moment",
        "--direction",
        "--by",
        "--turn",
        "--rotation",
        "--gravity",
        "--view",
        "--load",
    )
)
"""Options whose value is a vector; all but ``--view`` have three numbers."""


def joined(arguments: Sequence[str]) -> list[str]:
    """The arguments with numbers that follow such an option drawn together by commas.

    A negative number would otherwise be read as an option, and a second one as an argument.
    """
    out: list[str] = []
    rest = list(arguments)
    while rest:
        word = rest.pop(0)
        option, equals, first = word.partition("=")
        if option not in VECTORS:
            out.append(word)
            continue
        parts = [first] if equals else []
        while rest and len(parts) < 3 and _numbers(rest[0]):
            parts.append(rest.pop(0).strip(" ,"))
        out.append(f"{option}={','.join(parts)}" if parts else word)
    return out


def _numbers(word: str) -> bool:
    """Whether a word is a number, or several with commas between."""
    try:
        return bool([number_in(part) for part in word.strip(" ,").split(",")])
    except ValueError:
        return False
