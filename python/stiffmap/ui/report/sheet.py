"""A report of one table: the answer, its numbers, its pictures; one file, nothing from the network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from matplotlib.figure import Figure

from stiffmap.common.outputs import write_text
from stiffmap.ui.report.pictures import inline
from stiffmap.ui.report.provenance import provenance
from stiffmap.ui.report.templates import render


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
