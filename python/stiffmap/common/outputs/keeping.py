"""Two jobs never write one output: a lock file next to it, given back when the process ends, however it ends. And nothing that a user has
is replaced unasked: a command replaces what stiffmap wrote before, and none of its inputs."""

from __future__ import annotations

import errno
import hashlib
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from stiffmap.common.errors import FileError
from stiffmap.common.fingerprints import digest

_RESERVED: ContextVar[frozenset[str]] = ContextVar("reserved", default=frozenset())
"""Outputs that this job (of this thread) has locked."""
_AT_WORK: ContextVar[frozenset[str]] = ContextVar("at_work", default=frozenset())
"""Those among them that a function is writing in several steps."""
LONGEST_NAME = 200
"""Bytes of a name to which ``.lock`` can be added on every file system."""


@contextmanager
def only_job(path: str | os.PathLike[str]) -> Iterator[None]:
    """Hold an output, a file or a folder, while it is written in several steps.

    Raises FileError where another job holds it, and where nothing can be written there.
    """
    key = os.path.realpath(path)
    if key in _AT_WORK.get():  # called from within
        raise _taken(path)
    with reserved(path):
        _AT_WORK.set(_AT_WORK.get() | {key})
        try:
            yield
        finally:  # takes off its own alone: it may be closed late, by the garbage collector
            _AT_WORK.set(_AT_WORK.get() - {key})


@contextmanager
def reserved(path: str | os.PathLike[str]) -> Iterator[None]:
    """Lock an output for this job, once: a command does before it computes, each write does for itself.

    Devices are held by nobody. Raises FileError as `only_job`.
    """
    target = Path(os.path.realpath(path))
    if str(target) in _RESERVED.get() or is_device(target):
        yield
        return
    from filelock import FileLock, Timeout

    place = _lock_file(target, path)
    lock = FileLock(place, blocking=False)  # never through a symbolic link
    try:
        lock.acquire()
    except Timeout:
        raise _taken(path) from None
    except OSError as error:
        raise refused(path, error, place) from error
    _RESERVED.set(_RESERVED.get() | {str(target)})
    try:
        yield
    finally:
        _RESERVED.set(_RESERVED.get() - {str(target)})
        place.unlink(missing_ok=True)  # while it is held: whoever waits sees that this lock guards no name
        lock.release()


def _taken(path: str | os.PathLike[str]) -> FileError:
    return FileError("is being written by another job", file=os.fspath(path))


def refused(path: str | os.PathLike[str], error: OSError, other: Path | None = None) -> FileError:
    """What is said where the system refuses to write."""
    if error.errno == errno.ELOOP and other is not None:
        return FileError(
            f"cannot be written: its lock {other.name} is a symbolic link; delete that", file=os.fspath(path)
        )
    return FileError(f"cannot be written: {error.strerror or error}", file=os.fspath(path))


def is_device(target: Path) -> bool:
    """Whether something is there that is neither file nor folder: a device, a pipe."""
    try:
        return target.exists() and not target.is_file() and not target.is_dir()
    except OSError:
        return False


def _lock_file(target: Path, asked: str | os.PathLike[str]) -> Path:
    """Next to the output; above it where its folder is still missing, inside it where nothing can be next to it."""
    place, name = target.parent, target.name
    try:
        while not place.exists():
            place, name = place.parent, f"{place.name}+{name}"
        if not place.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR))
        target.exists()  # a name that is too long is refused here, with the name that was given
    except OSError as error:
        raise refused(asked, error) from error
    if target.is_dir() and not os.access(place, os.W_OK):
        return target / ".lock"
    return place / f".{short(name)}.lock"


def short(name: str) -> str:
    """The name, or where it is long another one that follows from it."""
    raw = os.fsencode(name)
    return name if len(raw) <= LONGEST_NAME else hashlib.sha256(raw).hexdigest()[:32]


class _Command:
    """What the command of this process has read, has written, and was asked to replace."""

    def __init__(self) -> None:
        self.read: set[str] = set()
        self.own: set[str] = set()
        self.asked: set[str] = set()


_RUNNING: list[_Command] = []
_HOOKED: list[bool] = []


def _seen(event: str, arguments: tuple[Any, ...]) -> None:
    """Every file that Python opens to read, whoever asks for it."""
    if event == "open" and _RUNNING and isinstance(arguments[1], str) and not set(arguments[1]) & set("wax+"):
        with suppress(Exception):  # a number, a name that the system refuses: no file of the user
            _RUNNING[-1].read.add(os.path.realpath(os.fsdecode(arguments[0])))


@contextmanager
def one_command() -> Iterator[None]:
    """While a command runs its inputs are noted, and `check_replaceable` holds; calls from Python are as they say."""
    if not _HOOKED:
        _HOOKED.append(True)
        sys.addaudithook(_seen)
    _RUNNING.append(_Command())
    try:
        yield
    finally:
        _RUNNING.pop()


def asked_to_replace(path: Path) -> None:
    """The user has said that this output, a file or a folder, may be replaced."""
    for command in _RUNNING:
        command.asked.add(os.path.realpath(path))


def new_file(file: Path, overwrite: bool, output: Path | None = None) -> Path:
    """A file to write, of the folder `output` or on its own; FileError where it is there already and may not be replaced."""
    if file.exists() and not overwrite:
        raise FileError("exists already; use --overwrite to replace it", file=str(file))
    if overwrite:
        asked_to_replace(output or file)
    return file


def check_replaceable(path: str | os.PathLike[str]) -> None:
    """FileError where something is at this output that is an input of the command, or that stiffmap did not write."""
    target = Path(os.path.realpath(path))
    if not _noted(target) or str(target) in _RUNNING[-1].own or not (target.is_file() or target.is_dir()):
        return
    command = _RUNNING[-1]
    inside = f"{target}{os.sep}"
    if any(f == str(target) or f.startswith(inside) for f in tuple(command.read)):
        what = "cannot be written: this command read it, and replaces no input; name another output"
        raise FileError(what, file=os.fspath(path))
    if command.asked & {str(target), str(target.parent)} or _nothing(target):
        return
    if _content(target) not in _notes(target):
        raise FileError(
            "cannot be written: something is there that no command of stiffmap wrote, or that was edited since; "
            "move or delete it, or name another output",
            file=os.fspath(path),
        )


def note_written(target: Path, fresh: Path) -> None:
    """Note that what is at `fresh` is about to stand at `target`: before it does, so that no kill leaves it unknown."""
    if not _noted(target):
        return
    _RUNNING[-1].own.add(str(target))
    note = _note(target)
    with suppress(OSError):  # no place to remember: the next command will ask
        note.parent.mkdir(parents=True, exist_ok=True)
        note.write_text(" ".join([*_notes(target)[-1:], _content(fresh)]), encoding="utf-8")


def _noted(target: Path) -> bool:
    """In a command, and not in a folder in which it grows an output, `.NAME.new` or `NAME.partial`."""
    folder = target.parent.name
    return bool(_RUNNING) and not (folder.startswith(".") or folder.endswith(".partial"))


def _note(target: Path) -> Path:
    """Where it is remembered, among the user's caches, what commands wrote at an output: what the last two are known by."""
    caches = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(caches) / "stiffmap" / "written" / digest(str(target))


def _notes(target: Path) -> list[str]:
    note = _note(target)
    return note.read_text(encoding="utf-8", errors="replace").split() if note.is_file() else []


def _content(path: Path) -> str:
    """What a file is known by: its size and when it was last written, so that large maps are not read again."""
    state = path.stat()
    return "folder" if path.is_dir() else f"{state.st_size}-{state.st_mtime_ns}"


def _nothing(target: Path) -> bool:
    return not any(target.iterdir()) if target.is_dir() else target.stat().st_size == 0
