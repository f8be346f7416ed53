"""What pages are made of: the jinja2 templates next to this file, pictures, where a report comes from; and the report of one table: the
answer, its numbers, its pictures. One file, no server, nothing from the network."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from io import BytesIO
from os import PathLike
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from matplotlib.figure import Figure
from PIL import Image

from stiffmap.common.fingerprints import file_digest
from stiffmap.common.outputs import write_text
from stiffmap.common.version import __version__

SHOWN = 16  # digits of a digest that are printed
PAUSE = 70  # ms between two frames


def provenance(
    date: str | None, seed: int | None, inputs: Iterable[str | PathLike[str]], digests: dict[str, str]
) -> list[tuple[str, str]]:
    """Rows of the table: what and its value. ``date`` is the caller's own words; files of ``inputs`` (of a folder, those in it)
    are hashed (SHA-256), ``digests`` are of what is only in memory. Raises FileError for a file that cannot be read."""
    rows = [("date", date or "not given"), ("stiffmap", __version__)]
    rows += [] if seed is None else [("seed", str(seed))]
    rows += [(f"file {path.name}", f"sha256 {file_digest(path)[:SHOWN]}") for path in _files(inputs)]
    return rows + [(name, f"sha256 {value[:SHOWN]}") for name, value in digests.items()]


def _files(inputs: Iterable[str | PathLike[str]]) -> list[Path]:
    out = []
    for given in map(Path, inputs):
        out += sorted(p for p in given.iterdir() if p.is_file()) if given.is_dir() else [given]
    return out


@cache
def templates(folder: Path) -> Environment:
    """The templates of a folder; what they are filled with is escaped."""
    return Environment(
        loader=FileSystemLoader(folder), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip


def render(template: str, /, **values: object) -> str:
    """A template filled in; values are escaped."""
    return templates(Path(__file__).parent / "pages").get_template(template).render(**values)


def inline(picture: Figure | bytes) -> str:
    """PNG of a figure, or a GIF, as a data address."""
    kind, data = ("gif", picture) if isinstance(picture, bytes) else ("png", _png(picture, 110))
    return f"data:image/{kind};base64," + base64.b64encode(data).decode()


def animation(frames: Iterable[Figure], dpi: int = 80) -> bytes:
    """GIF that goes through its frames, back, and on; each frame is drawn before the next one is asked for."""
    images = [
        Image.open(BytesIO(_png(figure, dpi))).convert("P", palette=Image.Palette.ADAPTIVE)
        for figure in frames
    ]
    buffer = BytesIO()
    images += images[-2:0:-1]
    images[0].save(
        buffer, format="GIF", save_all=True, append_images=images[1:], duration=PAUSE, loop=0, optimize=True
    )
    return buffer.getvalue()


def _png(figure: Figure, dpi: int) -> bytes:
    buffer = BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi)
    return buffer.getvalue()


@dataclass(frozen=True)
class ReportSheet:
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
    path: str | PathLike[str],
    sheet: ReportSheet,
    pictures: Mapping[str, Figure | bytes],
    digests: dict[str, str],
) -> Path:
    """Write the page; `pictures` by their captions (figures, or GIFs as bytes), `digests` of what went in. Raises FileError."""
    text = render(
        "sheet.html",
        sheet=sheet,
        pictures=[(caption, inline(figure)) for caption, figure in pictures.items()],
        provenance=provenance(None, None, (), digests)[1:],  # a command has no date of its own
    )
    return write_text(path, text)
