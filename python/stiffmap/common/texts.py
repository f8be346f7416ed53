"""Texts as strangers write them: the encoding and the ends of lines are found out."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from stiffmap.common.errors import FileError, reading

HEAD = 1 << 16
"""Bytes that show how a text is written."""


def text_of(path: Path) -> str:
    """A text in UTF-8, UTF-16 or Latin-1, each line ended by a line feed. Raises FileError."""
    with _decoding(path):
        raw = path.read_bytes()
        encoding = _encoding(raw[:HEAD])
        try:
            text = raw.decode(encoding)
        except UnicodeDecodeError:
            if encoding != "utf-8-sig":
                raise
            text = raw.decode("latin-1")  # never fails
    return text.replace("\r\n", "\n").replace("\r", "\n")


def lines_of(path: Path, newline: str | None = None) -> Iterator[str]:
    """Lines of a text file, ended by `newline` where the file has it or, where that is None, as any system ends them; a byte-order
    mark passed over; UTF-8 or UTF-16, and a line that is neither is Latin-1. Raises FileError where it cannot be read."""
    with _decoding(path):
        with path.open("rb") as raw:
            head = raw.read(HEAD)
        encoding = _encoding(head)
        newline = newline if "\n" in head.decode(encoding, "replace") else None
        errors = "surrogateescape" if encoding == "utf-8-sig" else "strict"
        with path.open(encoding=encoding, errors=errors, newline=newline) as stream:
            for line in stream:
                yield line if line.isascii() else _of_latin(line)


def _encoding(head: bytes) -> str:
    """By the mark or, without one, by the zero bytes that letters and digits have in UTF-16, all on one side."""
    if head[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    high, low = (head[side::2].count(0) for side in (0, 1))
    if 3 * (high + low) > len(head) and 0 in (high, low):
        return "utf-16-be" if high else "utf-16-le"
    return "utf-8-sig"


@contextmanager
def _decoding(path: Path) -> Iterator[None]:
    """FileError where a file cannot be read, or is not what it begins as."""
    try:
        with reading(path):
            yield
    except UnicodeDecodeError as error:
        raise FileError(
            f"begins as UTF-16 and is none ({error.reason} at byte {error.start})", file=str(path)
        ) from error


def _of_latin(line: str) -> str:
    try:
        line.encode()
    except UnicodeEncodeError:
        return line.encode("utf-8", "surrogateescape").decode("latin-1")
    return line
