"""Where a report comes from: date, version, seed, digests of what went in."""

from __future__ import annotations

from collections.abc import Iterable
from os import PathLike
from pathlib import Path

from stiffmap.common.fingerprints import file_digest
from stiffmap.common.version import __version__

SHOWN = 16
"""Digits of a digest that are printed."""


def provenance(
    date: str | None, seed: int | None, inputs: Iterable[str | PathLike[str]], digests: dict[str, str]
) -> list[tuple[str, str]]:
    """Rows of the table: what and its value. ``date`` is the caller's own words; files of ``inputs`` (of a folder, those in it)
    are hashed (SHA-256), ``digests`` are of what is only in memory."""
    rows = [("date", date or "not given"), ("stiffmap", __version__)]
    rows += [] if seed is None else [("seed", str(seed))]
    rows += [(f"file {path.name}", f"sha256 {digest_of(path)}") for path in _files(inputs)]
    return rows + [(name, f"sha256 {value[:SHOWN]}") for name, value in digests.items()]


def _files(inputs: Iterable[str | PathLike[str]]) -> list[Path]:
    out = []
    for given in map(Path, inputs):
        out += sorted(p for p in given.iterdir() if p.is_file()) if given.is_dir() else [given]
    return out


def digest_of(path: Path) -> str:
    """First digits of the SHA-256 of a file; raises FileError where it cannot be read."""
    return file_digest(path)[:SHOWN]
