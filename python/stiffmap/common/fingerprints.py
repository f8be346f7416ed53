"""What an answer depends on, as one word: the key of everything that is kept and taken up again."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path

from stiffmap.common.errors import reading
from stiffmap.common.python_file import code_run
from stiffmap.common.version import __version__


def digest(*parts: object) -> str:
    """Of plain data, arrays and dataclasses in any nesting: the same for the same values, another for any other."""
    out = hashlib.sha256()
    for part in parts:
        for piece in _pieces(part):
            out.update(len(piece).to_bytes(8, "little") + piece)
    return out.hexdigest()


def file_digest(path: Path) -> str:
    """Of the bytes of a file; raises FileError where it cannot be read."""
    with reading(path), path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def code() -> list[str]:
    """Version of stiffmap, and what users' Python files said when they were run."""
    return [__version__, *code_run()]


def named_files(data: object, folder: Path) -> list[tuple[str, str]]:
    """Names and digests of the files that plain data names, relative to a folder: link files, meshes, requirements."""
    found = {}
    for word in _words(data):
        try:
            path = folder / word
            if path.is_file():
                found[word] = file_digest(path)
        except (OSError, ValueError):  # no name of a file
            continue
    return sorted(found.items())


def _words(data: object) -> Iterator[str]:
    if isinstance(data, str):
        yield data
    elif isinstance(data, Mapping):
        for key, value in data.items():
            yield from _words(key)
            yield from _words(value)
    elif isinstance(data, Iterable):
        for value in data:
            yield from _words(value)


def _pieces(value: object) -> Iterator[bytes]:
    """Bytes that say type and value; what is nested is preceded by its size."""
    import numpy as np

    if isinstance(value, np.ndarray):
        a = np.ascontiguousarray(value)
        yield f"array {a.dtype.str} {a.shape}".encode()
        yield a.tobytes()
    elif is_dataclass(value) and not isinstance(value, type):
        kept = [field for field in fields(value) if not field.metadata.get("derived")]
        yield f"{type(value).__name__} {len(kept)}".encode()
        for field in kept:
            yield field.name.encode()
            yield from _pieces(getattr(value, field.name))
    elif isinstance(value, Mapping):
        yield f"mapping {len(value)}".encode()
        for key, item in value.items():
            yield from _pieces(key)
            yield from _pieces(item)
    elif isinstance(value, list | tuple):
        yield f"sequence {len(value)}".encode()
        for item in value:
            yield from _pieces(item)
    elif isinstance(value, set | frozenset):
        yield f"set {sorted(map(repr, value))}".encode()
    elif isinstance(value, bytes):
        yield b"bytes"
        yield value
    else:
        yield f"{type(value).__name__} {value!r}".encode()
