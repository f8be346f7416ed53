"""Two jobs never write one output: a lock file next to it, given back when the process ends, however it ends."""

from __future__ import annotations

import errno
import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from stiffmap.common.errors import FileError

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
