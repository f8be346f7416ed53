"""What pages are made of: the jinja2 templates next to this file, where a report comes from; and the report of one table:
the answer, its numbers, its pictures; one file, nothing from the network."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from os import PathLike
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from matplotlib.figure import Figure

from stiffmap.common.fingerprints import file_digest
from stiffmap.common.outputs import write_text
from stiffmap.common.version import __version__
from stiffmap.ui.report.pictures import inline

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


@cache
def _environment() -> Environment:
    return Environment(
        loader=FileSystemLoader(Path(__file__).parent / "pages"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def render(template: str, /, **values: Any) -> str:
    """A template filled in; values are escaped."""
    return _environment().get_template(template).render(**values)


@dataclass(frozen=True)
class Sheet:
    """What the page says, in the units that it shows."""

    title: str
    answer: str
    lines: Sequence[str]
    """Sentences below the answer."""
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    numbers: Sequence[int] = ()
    """Columns, from 1, whose cells are numbers."""


def write_sheet(
    path: str | PathLike[str], sheet: Sheet, pictures: Mapping[str, Figure | bytes], digests: dict[str, str]
) -> Path:
    """Write the page; `pictures` by their captions (figures, or GIFs as bytes), `digests` of what went in. Raises FileError."""
    text = render(
        "sheet.html",
        sheet=sheet,
        pictures=[(caption, inline(figure)) for caption, figure in pictures.items()],
        provenance=provenance(None, None, (), digests)[1:],  # a command has no date of its own
    )
    return write_text(path, text)
