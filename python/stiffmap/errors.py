"""Errors that stiffmap raises for bad input: one clear sentence each, never repaired silently."""

from __future__ import annotations

import re

LONGEST_WORD, LONGEST_MESSAGE = 400, 3000  # characters


class StiffmapError(ValueError):
    """A problem in what the user gave, told in one line; what was found is shortened where it is very long."""

    def __init__(self, message: object = "") -> None:
        super().__init__(shortened(str(message)))


class FileError(StiffmapError):
    """A file that cannot be used: says which file, which line, which key, and what is wrong.

    ``file``, ``line`` (``None`` where unknown) and ``key`` (dotted path) are kept as attributes.
    """

    def __init__(self, message: str, *, file: str = "", line: int | None = None, key: str = "") -> None:
        place = file if line is None else f"{file}, line {line}"
        super().__init__(": ".join(part for part in (place, key, message) if part))
        self.file, self.line, self.key, self.reason = file, line, key, message


class UnknownMachineError(StiffmapError):
    """No shipped machine and no file of that name."""


class MissingPartError(StiffmapError):
    """An optional part of stiffmap, or a package that it needs, is not installed."""


def shortened(message: str) -> str:
    """The message without the middle of endless words, and without its end where it is endless itself."""
    cut = re.sub(rf"\S{{{LONGEST_WORD},}}", lambda m: f"{m[0][:60]}…{m[0][-20:]}", message)
    left = len(cut) - LONGEST_MESSAGE
    return cut if left <= 0 else f"{cut[:LONGEST_MESSAGE]}… ({left} more characters)"
