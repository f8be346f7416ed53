"""Errors that stiffmap raises for bad input: one clear sentence each, never repaired silently."""

from __future__ import annotations

import difflib
import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from types import FrameType

LONGEST_WORD, LONGEST_MESSAGE = 400, 3000  # characters
MOST_PROBLEMS = 20  # shown of one file


class StiffmapError(ValueError):
    """A problem in what the user gave, stated in one line; what was found is shortened where it is very long."""

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


class MissingColumnError(FileError):
    """A table lacks a column that it needs."""


class NoTableError(FileError):
    """A text, or a sheet of a workbook, that holds no table."""


class FileErrors(FileError):
    """Several problems of one file, one line each and the first twenty of them; ``problems`` holds all, the
    other attributes are those of the first."""

    def __init__(self, problems: Sequence[FileError]) -> None:
        first = problems[0]
        super().__init__(first.reason, file=first.file, line=first.line, key=first.key)
        lines = [str(p) for p in problems[:MOST_PROBLEMS]]
        if len(problems) > MOST_PROBLEMS:
            lines.append(f"... and {len(problems) - MOST_PROBLEMS} more problems in this file")
        self.args = ("\n".join(lines),)
        self.problems = tuple(problems)


def together(problems: Sequence[FileError]) -> FileError:
    """One error of one or more problems: each once, in the order of the lines."""
    flat = [one for p in problems for one in (p.problems if isinstance(p, FileErrors) else (p,))]
    each = sorted({str(p): p for p in flat}.values(), key=lambda p: p.line or 0)
    return each[0] if len(each) == 1 else FileErrors(each)


class UnknownMachineError(StiffmapError):
    """No shipped machine and no file of that name."""


class HomeError(StiffmapError):
    """The home configuration of a machine does not close."""


class MissingPartError(StiffmapError):
    """An optional part of stiffmap, or a package that it needs, is not installed."""


@contextmanager
def needed(what: str, extra: str, otherwise: str = "") -> Iterator[None]:
    """Imports that `what` needs and an `extra` of stiffmap brings; MissingPartError where one is not there."""
    try:
        yield
    except ImportError as error:
        raise MissingPartError(
            f"{what} needs {error.name}, which is not installed: pip install 'stiffmap[{extra}]'{otherwise}"
        ) from error


ROBOT_PROGRAMS = {".ls": "Fanuc", ".mod": "RAPID", ".src": "KRL", ".script": "URScript"}
"""Languages of robots by the ending of their files."""


@contextmanager
def reading(path: object) -> Iterator[None]:
    """FileError where the system refuses to read a file, and for a robot's program."""
    if language := ROBOT_PROGRAMS.get(Path(str(path)).suffix.lower()):
        raise FileError(
            f"a robot's program ({language}) is not read; "
            "expected a machine file or URDF of the robot, G-code or APT of the part, or a table of the poses",
            file=str(path),
        )
    try:
        yield
    except OSError as error:
        raise FileError(f"cannot be read: {error.strerror}", file=str(path)) from error


def refuse_folder(path: str | PathLike[str], expected: str) -> None:
    """FileError for a folder where a file is expected."""
    if str(path) and Path(path).is_dir():
        raise FileError(f"expected {expected}, found a folder", file=str(path))


def suggestion(word: str, known: Iterable[str]) -> str:
    """`` (did you mean 'length'?)`` or nothing."""
    near = difflib.get_close_matches(word, list(known), n=1, cutoff=0.6)
    return f" (did you mean '{near[0]}'?)" if near else ""


def unknown_name(what: str, name: str, known: Iterable[str]) -> str:
    """That there is nothing of this name, the nearest name, and all that there are."""
    names = list(known)
    return f"no {what} '{name}'{suggestion(name, names)}; there are: {', '.join(names) or 'none'}"


def shortened(message: str) -> str:
    """The message without the middle of endless words, and without its end where it is endless itself."""
    cut = re.sub(rf"\S{{{LONGEST_WORD},}}", lambda m: f"{m[0][:60]}…{m[0][-20:]}", message)
    left = len(cut) - LONGEST_MESSAGE
    return cut if left <= 0 else f"{cut[:LONGEST_MESSAGE]}… ({left} more characters)"


def frames_of_this_package() -> int:
    """How many callers, from the function that asks on, are in stiffmap itself."""
    frame: FrameType | None = sys._getframe(1)
    count = 1
    while frame is not None and frame.f_globals.get("__name__", "").partition(".")[0] == "stiffmap":
        frame, count = frame.f_back, count + 1
    return count
