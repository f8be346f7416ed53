"""Pictures inside a page, still and moving."""

from __future__ import annotations

import base64
from collections.abc import Iterable
from io import BytesIO

from matplotlib.figure import Figure
from PIL import Image

PAUSE = 70
"""ms between two frames."""


def inline(picture: Figure | bytes) -> str:
    """PNG of a figure, or a GIF, as a data address."""
    kind, data = ("gif", picture) if isinstance(picture, bytes) else ("png", _png(picture, 110))
    return f"data:image/{kind};base64," + base64.b64encode(data).decode()


def animation(frames: Iterable[Figure], dpi: int = 80) -> bytes:
    """GIF that repeats; each frame is drawn before the next one is asked for."""
    images = [
        Image.open(BytesIO(_png(figure, dpi))).convert("P", palette=Image.Palette.ADAPTIVE)
        for figure in frames
    ]
    buffer = BytesIO()
    images[0].save(
        buffer, format="GIF", save_all=True, append_images=images[1:], duration=PAUSE, loop=0, optimize=True
    )
    return buffer.getvalue()


def _png(figure: Figure, dpi: int) -> bytes:
    buffer = BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi)
    return buffer.getvalue()
