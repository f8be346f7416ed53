"""What all pictures share."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from io import BytesIO
from pathlib import Path
from textwrap import fill
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from stiffmap.common import number_text
from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.common.outputs import writing
from stiffmap.solve.labels import WRENCH

MM, UM = 1e3, 1e6
# Okabe and Ito's palette: eight colours that the common colour blindnesses keep apart.
BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILLION, BLACK = (
    "#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#000000",
)  # fmt: skip
CYCLE = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK)
DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 1)), (0, (8, 2)))
TOLERANCE = VERMILLION
COLOURS = "cividis"
BEFORE, AFTER = "#c1432e", "#2a6f97"
"""What the machine of the file leaves of readings, and a corrected one."""

SETTINGS: dict[str, Any] = {
    **dict.fromkeys(("font.size", "axes.titlesize", "axes.labelsize"), 9),
    **dict.fromkeys(("legend.fontsize", "xtick.labelsize", "ytick.labelsize"), 8),
    **dict.fromkeys(("axes.linewidth", "hatch.linewidth"), 0.6),
    "legend.frameon": False,
}


def paper_style() -> AbstractContextManager[None]:
    """Settings of a picture while it is drawn; the caller's own settings come back."""
    return matplotlib.rc_context(dict[Any, Any](SETTINGS))


class Picture(Figure):
    """A figure that a notebook shows, whether pyplot is loaded or not."""

    def draw(self, renderer: RendererBase) -> None:
        """Where matplotlib wants the layout alone, for which it puts what draws nothing on the renderer itself, only that is computed."""
        engine = self.get_layout_engine() if self.axes and "open_group" in vars(renderer) else None
        if engine is not None:
            engine.execute(self)
        else:
            super().draw(renderer)

    def _repr_png_(self) -> bytes:
        out = BytesIO()
        canvas: Any = FigureCanvasAgg(self)
        canvas.print_png(out)
        return out.getvalue()


def new_figure(width: float, height: float) -> Figure:
    """An empty figure (inches) that belongs to no window system."""
    return Picture(figsize=(width, height), layout="constrained")


EDGE = 0.98  # share of a picture's width that a title or a legend may take


def _renderer(figure: Figure) -> RendererBase:
    canvas: Any = FigureCanvasAgg(figure)
    renderer: RendererBase = canvas.get_renderer()
    return renderer


def headline(figure: Figure, text: str) -> None:
    """Title of the whole picture, broken into lines where it is wider than the picture."""
    artist = figure.suptitle(text, fontsize=10)
    renderer = _renderer(figure)
    for columns in range(len(text), 15, -1):
        if artist.get_window_extent(renderer).width <= EDGE * figure.bbox.width:
            return
        artist.set_text("\n".join(fill(line, columns) for line in text.splitlines()))


def legend_below(figure: Figure, most: int = 7) -> None:
    """Legend of all axes under the picture, in as many columns as its width and `most` allow."""
    handles = [h for ax in figure.axes for h in ax.get_legend_handles_labels()[0]]
    entries = {str(h.get_label()): h for h in handles}
    renderer = _renderer(figure)
    for columns in range(min(len(entries), most), 0, -1):
        legend = figure.legend(handles=list(entries.values()), loc="outside lower center", ncols=columns)
        if columns == 1 or legend.get_window_extent(renderer).width <= EDGE * figure.bbox.width:
            return
        legend.remove()


@contextmanager
def paper(width: float, height: float, title: str = "", *, most: int = 7) -> Iterator[Figure]:
    """An empty figure (inches), drawn in the style of all pictures; at the end it gets its title, and a legend of what its axes
    hold, in at most `most` columns (0: none)."""
    with paper_style():
        figure = new_figure(width, height)
        yield figure
        if title:
            headline(figure, title)
        legend_below(figure, most=most)


def length_unit(largest: float) -> tuple[str, float]:
    """Unit and factor of an axis for deflections up to this size (m): no 0.0xx mm."""
    return number_text.length_unit(largest, 0.0995e-3)[:2]


def wrench_text(wrench: Floats) -> str:
    """What of a wrench (6,) is not zero, for example ``fx = 100 N``."""
    dust = 1e-9 * float(np.abs(wrench).max(initial=0.0))
    parts = [
        f"{n} = {v:g} {'N' if n[0] == 'f' else 'N·m'}"
        for n, v in zip(WRENCH, wrench, strict=True)
        if abs(v) > dust
    ]
    return ", ".join(parts) or "no wrench"


def leg_colours(legs: Sequence[str]) -> dict[str, str]:
    """Colour of each leg, the same in all pictures; black for base and platform."""
    return {leg: CYCLE[i % len(CYCLE)] for i, leg in enumerate(legs)} | {"": BLACK}


def line_look(index: int) -> dict[str, Any]:
    """Colour and dashes of one of several lines."""
    return {"color": CYCLE[index % len(CYCLE)], "ls": DASHES[index % len(DASHES)]}


def panel(index: int, of: int = 2) -> str:
    """(a), (b), (c) …; empty for the only one."""
    return f"({chr(ord('a') + index)})" if of > 1 else ""


DPI = 150


def save(figure: Figure, path: str | os.PathLike[str]) -> Path:
    """Write a picture in the format that the file's name says; the same picture gives the same bytes.

    Raises FileError where the file cannot be written, StiffmapError for an unknown format.
    """
    target = Path(path)
    metadata = {"Software": None} if target.suffix == ".png" else None
    try:
        with paper_style(), writing(target) as fresh:
            figure.savefig(fresh, dpi=DPI, metadata=metadata)
    except StiffmapError:
        raise
    except ValueError as error:
        raise StiffmapError(f"{target}: {error}") from error
    return target
