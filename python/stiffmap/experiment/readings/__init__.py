"""What a row may read in addition to the six axes of a pose and joints: the kinds of this package, and those that users
register."""

from __future__ import annotations

from os import PathLike

import stiffmap.experiment.readings.library as library
from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.common.python_file import modules_of, run_python_file
from stiffmap.experiment.channels import AXES, Channel
from stiffmap.experiment.readings.types import ReadingKind, Seen

__all__ = ["ReadingKind", "Seen", "kind_of", "kinds", "load_readings", "register", "unregister"]

_found = (k for m in modules_of(library) for k in vars(m).values() if isinstance(k, ReadingKind))
_LIBRARY = {kind.name: kind for kind in _found}
_KNOWN = dict(_LIBRARY)


def kinds() -> tuple[ReadingKind, ...]:
    """All kinds, those of the library first."""
    return tuple(_KNOWN.values())


def kind_of(channel: Channel) -> ReadingKind | None:
    """The kind that a channel is of; None for the axes of a pose and for joints."""
    return None if channel.joint else _KNOWN.get(channel.name)


def register(kind: ReadingKind) -> ReadingKind:
    """Make a kind known to files, prediction and diagnosis; returns it. One that was registered before is replaced.

    Raises StiffmapError for a name that is taken, or a unit other than m and rad.
    """
    if kind.name in (*AXES, *_LIBRARY) or not kind.name.isidentifier():
        raise StiffmapError(f"reading {kind.name!r}: expected a name of its own, as a column may have")
    if kind.unit not in ("m", "rad"):
        raise StiffmapError(f"reading {kind.name!r}: unit: expected m or rad, got {kind.unit!r}")
    if bool(kind.absolute) != (kind.commanded is not None):
        raise StiffmapError(f"reading {kind.name!r}: absolute and commanded go together")
    _KNOWN[kind.name] = kind
    return kind


def unregister(name: str) -> None:
    """Forget a kind that was registered."""
    if name not in _LIBRARY:
        _KNOWN.pop(name, None)


def load_readings(path: str | PathLike[str]) -> ReadingKind:
    """Run a Python file and register its ``READING``; raises `FileError` where it has none."""
    module = run_python_file(path, "reading", "a kind of reading")
    kind = getattr(module, "READING", None)
    if not isinstance(kind, ReadingKind):
        raise FileError("defines no reading: expected READING = ReadingKind(...)", file=str(path))
    return register(kind)
