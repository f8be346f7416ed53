"""Errors that stiffmap raises for bad input: one clear sentence each, never repaired silently."""

from __future__ import annotations


class StiffmapError(ValueError):
    """A problem in what the user gave, told in one line."""


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
