"""One line of G-code: words, comments, and what is refused by name."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple, NoReturn

from stiffmap.common.errors import FileError

_COMMENT = re.compile(r"\([^()]*\)|;.*")
_PARTS = re.compile(r"(\([^()]*\)|;.*)")
_ANY = re.compile(r"[A-Z][+-]?[\d.]+", re.IGNORECASE | re.ASCII)
_WORD = re.compile(r"([A-Z])([+-]?(?:\d+\.?\d*|\.\d+))", re.ASCII)
_BLANKS = dict.fromkeys(b" \t\n\v\f\r")
_REFUSED = (
    ("#", "parameters (#) are not read: expand them in the program that wrote the file"),
    ("[", "expressions in brackets are not read: write numbers"),
)
names_program = re.compile(r"%?|[O:%]\d+|%_N_\w+", re.ASCII).fullmatch
"""Whether a bare line holds at most the number or name of the program."""
OWN_LANGUAGE = "of Heidenhain, KRL, RAPID, Siemens's words (X=IC(5)) and the like, export G-code (ISO), APT or points (.csv)"
LARGEST = 1e9
LONGEST = 10_000
"""Characters of a line."""


class ProgramBlock(NamedTuple):
    """Words of a line in their order, and whether a slash stood ahead (block delete)."""

    words: tuple[tuple[str, float], ...]
    optional: bool


def tokens_of(text: str) -> Iterator[str]:
    """Comments as they stand, and words without blanks, of a line that `read_block` reads; a slash ahead is one."""
    for part in _PARTS.split(text):
        if part.startswith(("(", ";")):
            yield part.strip()
        else:
            inked = part.translate(_BLANKS)
            if inked.startswith("/"):
                yield "/"
            yield from (m[0] for m in _ANY.finditer(inked))


def plain(token: str) -> str:
    """A word as it is compared: ``g01`` is ``G1``; a comment stays."""
    match = _WORD.fullmatch(token.upper())
    return token if match is None else f"{match[1]}{float(match[2]):g}"


def bare(text: str) -> str:
    """Letters and numbers of a line, without comments and blanks."""
    return (_COMMENT.sub("", text) if "(" in text or ";" in text else text).translate(_BLANKS).upper()


def decimal(value: float, digits: int) -> str:
    """A number to so many decimals, one or more, without zeros at its end."""
    text = f"{value:.{digits}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def fail(file: str, number: int, message: str) -> NoReturn:
    """Raise an error at a line."""
    raise FileError(message, file=file, line=number)


def read_block(text: str, file: str, number: int) -> ProgramBlock:
    """Words of a line; blanks do not count, nor does case. Raises `FileError` for what is no word."""
    if len(text) > LONGEST:
        fail(file, number, f"expected at most {LONGEST} characters, found {len(text)}")
    line = bare(text)
    if names_program(line.lstrip("/")):
        return ProgramBlock((), False)
    if "(" in line or ")" in line:
        fail(file, number, "a comment is not closed, or closed twice")
    for sign, message in _REFUSED:
        if sign in line:
            fail(file, number, message)
    optional = line[0] == "/"
    line = line[1:] if optional else line
    if line[:1] == "O":
        fail(file, number, f"subprograms and loops (O words) are not read: {text.strip()[:40]!r}")
    parts = _WORD.split(line)
    if any(parts[::3]):
        wrong = next(k for k, between in enumerate(parts[::3]) if between)
        found = "".join(parts[3 * wrong :])[:30]
        fail(file, number, f"expected words such as X12.5, found {found!r}; {OWN_LANGUAGE}")
    words = tuple(zip(parts[1::3], map(float, parts[2::3]), strict=True))
    if "N" in line[1:] or line.startswith("N-"):
        fail(file, number, f"N: expected the line's number at its beginning, found {line[:40]!r}")
    for letter, value in words:
        if not -LARGEST <= value <= LARGEST:
            fail(file, number, f"the number of {letter} is too large")
    return ProgramBlock(words, optional)
