"""The one place that writes files. An output appears whole: written next to its place, flushed to the disk, then renamed over what
was there; tables as CSV, which no spreadsheet mistakes for programs.

Space is asked for before it is used: a mapped array in a sparse file dies of a signal on a full disk.
"""

from __future__ import annotations

import csv
import itertools
import os
import re
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.common.outputs.keeping import (
    asked_to_replace as asked_to_replace,
    check_replaceable,
    is_device,
    new_file as new_file,
    note_written,
    one_command as one_command,
    only_job as only_job,
    refused,
    reserved as reserved,
    short,
)

if TYPE_CHECKING:
    from numpy.typing import DTypeLike


@contextmanager
def writing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A path, with the same ending, to write a file to; what was at `path` stays until the new file is complete.

    A symbolic link stays and its file is replaced; a device or a pipe is given the whole file at its end. Raises
    FileError where it cannot be written or another job writes it.
    """
    if not isinstance(path, str | os.PathLike):
        raise StiffmapError(f"path: expected a file, got {type(path).__name__}")
    target = Path(os.path.realpath(path))
    try:
        if target.is_dir():
            raise FileError("cannot be written: it is a folder", file=os.fspath(path))
        check_replaceable(path)
        if is_device(target):
            with tempfile.TemporaryDirectory() as folder:
                fresh = Path(folder) / f"output{target.suffix}"
                yield fresh
                with fresh.open("rb") as source, target.open("wb") as sink:
                    shutil.copyfileobj(source, sink)
            return
        with reserved(path):
            yield from _replaced(target)
    except OSError as error:
        raise refused(path, error) from error


def _replaced(target: Path) -> Iterator[Path]:
    """The scratch file, then the rename."""
    mode = None
    if target.exists():
        mode = target.stat().st_mode & 0o777
        if not os.access(target, os.W_OK):  # a rename would not ask
            raise PermissionError(13, "Permission denied")
    fresh = target.with_name(f".{short(target.name)}.writing{target.suffix[:20]}")
    fresh.unlink(missing_ok=True)  # what a killed job left
    try:
        os.close(os.open(fresh, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        yield fresh
        if mode is not None:
            fresh.chmod(mode)
        synced(fresh)
        note_written(target, fresh)
        os.replace(fresh, target)
        synced(target.parent)
    finally:
        with suppress(OSError):
            fresh.unlink(missing_ok=True)


def synced(path: Path) -> None:
    """Wait until a file or the names in a folder are on the disk."""
    if os.name == "nt" and path.is_dir():
        return  # a folder cannot be opened there
    handle = os.open(path, os.O_RDWR if os.name == "nt" else os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def write_text(
    path: str | os.PathLike[str], text: str, encoding: str = "utf-8", errors: str = "strict"
) -> Path:
    """Write a text file; raises FileError where it cannot be written."""
    with writing(path) as fresh:
        fresh.write_text(text, encoding=encoding, errors=errors)
    return Path(path)


def make_folder(path: str | os.PathLike[str]) -> Path:
    """The folder, made where it is missing; raises FileError where it cannot be."""
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise refused(path, error) from error
    return folder


def put_folder(fresh: Path, path: Path) -> None:
    """Put a complete folder in the place of another one (of files that stiffmap wrote); FileError."""
    check_replaceable(path)
    try:
        for file in fresh.rglob("*"):
            synced(file)
        note_written(Path(os.path.realpath(path)), fresh)
        old = path.with_name(f".{path.name}.old")
        shutil.rmtree(old, ignore_errors=True)
        if path.is_dir():
            os.replace(path, old)
        os.replace(fresh, path)
        synced(path.parent)
        shutil.rmtree(old, ignore_errors=True)
    except OSError as error:
        raise refused(path, error) from error


@contextmanager
def putting(folder: str | os.PathLike[str], head: str) -> Iterator[Path]:
    """A fresh folder for files that belong together; complete, they are put into `folder`, whose other files stay.

    `head` is the file without which the others are nothing: the old one goes before they change and the new one comes after
    them, so that a kill leaves the old files, the new ones or a folder that says what it lacks, never a mixture. Raises
    FileError.
    """
    path = Path(folder)
    there = next(p for p in (path, *path.absolute().parents) if p.is_dir())
    fresh = there / f".{short(path.name)}.new"
    with only_job(folder):
        shutil.rmtree(fresh, ignore_errors=True)  # of a job that was killed
        try:
            yield make_folder(fresh)
            _put_files(fresh, path, head)
        finally:
            shutil.rmtree(fresh, ignore_errors=True)


def _put_files(fresh: Path, folder: Path, head: str) -> None:
    files = sorted(fresh.iterdir(), key=lambda f: (f.name == head, f.name))
    for file in files:
        check_replaceable(folder / file.name)
    target = Path(os.path.realpath(make_folder(folder)))
    try:
        for file in files:
            note_written(target / file.name, file)
        if len(files) > 1:
            (target / head).unlink(missing_ok=True)
            synced(target)
        for file in files:
            os.replace(file, target / file.name)
        synced(target)
    except OSError as error:
        raise refused(folder, error) from error


def add_lines(path: Path, lines: Iterable[str], flushed: bool = True) -> None:
    """Add whole lines to a journal; OSError where the disk refuses.

    A line that a killed job did not finish is ended first, so that it is one damaged line and no more.
    """
    with path.open("ab+") as file:
        if file.tell():
            file.seek(-1, os.SEEK_END)
            if file.read(1) != b"\n":
                file.write(b"\n")
        file.write("".join(f"{line}\n" for line in lines).encode())
        file.flush()
        if flushed:
            os.fsync(file.fileno())


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


RUN = re.compile(r"'*[=+\-@\t\r]")
"""What a spreadsheet may take for a formula, and the same behind the quotes of `guarded`."""
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


def guarded(cell: object) -> object:
    """Text that a spreadsheet would run as a formula, with a ``'`` before it; numbers and other text as they are."""
    if isinstance(cell, str) and RUN.match(cell) and not NUMBER.fullmatch(cell):
        return f"'{cell}"
    return cell


def unguarded(cell: str) -> str:
    """The text of a cell that `guarded` wrote."""
    return cell[1:] if cell.startswith("'") and RUN.match(cell) else cell


def number_cells(values: Iterable[float]) -> list[str]:
    """Numbers (n,) as cells of nine digits, empty where they are NaN."""
    return ["" if v != v else f"{v:.9g}" for v in values]


def write_rows(
    path: str | os.PathLike[str],
    header: Sequence[str],
    rows: Iterable[Sequence[object]],
    encoding: str = "utf-8",
) -> int:
    """Write a CSV file: a header and rows; returns their number. Raises FileError where it cannot be written."""
    count = itertools.count()
    with writing(path) as fresh, fresh.open("w", newline="", encoding=encoding) as stream:
        out = csv.writer(stream)
        out.writerow([guarded(c) for c in header])
        each = (row for row, _ in zip(rows, count, strict=False))
        out.writerows([guarded(c) if type(c) is str else c for c in row] for row in each)
    return next(count)
