"""Texts as strangers write them: the encoding and the ends of lines are found out."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from stiffmap.common.errors import FileError, reading

HEAD = 1 << 16
"""Bytes that show how a text is written."""

COMMON_CHINESE = re.compile(rb"(?:[\x00-\x7f]|[\xa1-\xa3\xa6\xb0-\xd7][\xa1-\xfe])*")
"""Signs and the common words in GB 2312, two bytes each; in Latin-1 hardly two such bytes stand next to each other."""


def text_of(path: Path) -> str:
    """A text, each line ended by a line feed. Raises FileError."""
    return "".join(lines_of(path))


def lines_of(path: Path, newline: str | None = None) -> Iterator[str]:
    """Lines of a text file, ended by `newline` where the file has it or, where that is None, as any system ends them; a byte-order
    mark passed over; UTF-8 or UTF-16, and a line that is neither is GB 2312 or Latin-1. Raises FileError where it cannot be read."""
    with reading(path), path.open("rb") as raw:
        head = raw.read(HEAD)
    encoding = _encoding(head)
    newline = newline if "\n" in head.decode(encoding, "replace") else None
    errors = "surrogateescape" if encoding == "utf-8-sig" else "strict"
    try:
        with reading(path), path.open(encoding=encoding, errors=errors, newline=newline) as stream:
            for line in stream:
                yield line if line.isascii() else _of_latin(line)
    except UnicodeDecodeError as error:
        raise FileError(f"begins as UTF-16 and is none ({error.reason})", file=str(path)) from error


def _encoding(head: bytes) -> str:
    """By the mark or, without one, by the zero bytes that letters and digits have in UTF-16, all on one side."""
    if head[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    high, low = (head[side::2].count(0) for side in (0, 1))
    if 3 * (high + low) > len(head) and 0 in (high, low):
        return "utf-16-be" if high else "utf-16-le"
    return "utf-8-sig"


def _of_latin(line: str) -> str:
    try:
        line.encode()
    except UnicodeEncodeError:
        raw = line.encode("utf-8", "surrogateescape")
        return raw.decode("gb18030" if COMMON_CHINESE.fullmatch(raw) else "latin-1")
    return line
