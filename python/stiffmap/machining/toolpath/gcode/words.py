"""One line of G-code: words, comments, and what is refused by name."""

from __future__ import annotations

import re
from typing import NamedTuple, NoReturn

from stiffmap.common.errors import FileError

_COMMENT = re.compile(r"\([^()]*\)|;.*")
_WORD = re.compile(r"([A-Z])([+-]?(?:\d+\.?\d*|\.\d+))")
_REFUSED = (
    ("#", "parameters (#) are not read: expand them in the program that wrote the file"),
    ("[", "expressions in brackets are not read: write numbers"),
)
LARGEST = 1e9
LONGEST = 10_000
"""Characters of a line."""


class Block(NamedTuple):
    """Words of a line in their order, and whether a slash stood ahead (block delete)."""

    words: tuple[tuple[str, float], ...]
    optional: bool


def fail(file: str, number: int, message: str) -> NoReturn:
    """Raise an error at a line."""
    raise FileError(message, file=file, line=number)


def read_block(text: str, file: str, number: int) -> Block:
    """Words of a line; blanks do not count, nor does case. Raises `FileError` for what is no word."""
    if len(text) > LONGEST:
        fail(file, number, f"expected at most {LONGEST} characters, found {len(text)}")
    bare = _COMMENT.sub("", text) if "(" in text or ";" in text else text
    bare = "".join(bare.split()).upper()
    if not bare or bare == "%":
        return Block((), False)
    if "(" in bare or ")" in bare:
        fail(file, number, "a comment is not closed, or closed twice")
    for sign, message in _REFUSED:
        if sign in bare:
            fail(file, number, message)
    optional = bare.startswith("/")
    bare = bare.removeprefix("/")
    if bare.startswith("O"):
        fail(file, number, f"subprograms and loops (O words) are not read: {text.strip()[:40]!r}")
    words, at = [], 0
    for match in _WORD.finditer(bare):
        if match.start() != at:
            break
        words.append((match[1], float(match[2])))
        at = match.end()
    large = [w for w in words if abs(w[1]) > LARGEST]
    if large:
        fail(file, number, f"the number of {large[0][0]} is too large")
    if at != len(bare):
        fail(file, number, f"expected words such as X12.5, found {bare[at : at + 30]!r}")
    return Block(tuple(words), optional)
