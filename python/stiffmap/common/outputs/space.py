"""Space on the disk, asked for before it is used: a mapped array in a sparse file dies of a signal on a full disk."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stiffmap.common.errors import FileError

if TYPE_CHECKING:
    from numpy.typing import DTypeLike


def needs_space(path: Path, size: float, what: str) -> None:
    """FileError where the disk of `path` has no `size` bytes free."""
    place = path
    while not place.exists():
        place = place.parent
    try:
        free = shutil.disk_usage(place).free
    except OSError:
        return  # not known: the write itself will say
    if free < size:
        raise FileError(
            f"cannot be written: {what} needs {bytes_text(size)}, {bytes_text(free)} are free", file=str(path)
        )


def mapped_array(path: Path, dtype: DTypeLike, shape: tuple[int, ...]) -> Any:
    """A new array in a file, whose whole space the disk has granted; OSError where it does not."""
    from numpy.lib.format import open_memmap

    path.unlink(missing_ok=True)
    try:
        array = open_memmap(path, "w+", dtype, shape)
        if hasattr(os, "posix_fallocate"):
            with path.open("r+b") as file:
                os.posix_fallocate(file.fileno(), 0, path.stat().st_size)
    except OSError:
        path.unlink(missing_ok=True)
        raise
    return array


def bytes_text(size: float) -> str:
    """A number of bytes in the unit that suits it."""
    for unit in ("bytes", "kB", "MB", "GB"):
        if size < 1000:
            return f"{size:.3g} {unit}"
        size /= 1000
    return f"{size:.3g} TB"
