"""A plane as an image: colours of values, hatching where a pose failed, nothing outside the box."""

from __future__ import annotations

from functools import cache

import matplotlib
import numpy as np
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from stiffmap.solve.status import Status
from stiffmap.ui.plot.style import BLUE, COLOURS, ORANGE, PURPLE, VERMILLION
from stiffmap.ui.view.plane import PlaneMap

Image = NDArray[np.uint8]
HATCHED, PERIOD = 4, 8
"""Pixels per pose where there is something to hatch (else one), and from one line to the next."""
GREY, DARK = (205, 205, 205), (120, 40, 40)


def rgb(colour: str) -> tuple[int, int, int]:
    """0 to 255."""
    r, g, b = (round(255 * v) for v in to_rgb(colour))
    return r, g, b


STATUS_COLOURS = {
    Status.CONVERGED: rgb(BLUE),
    Status.UNREACHABLE: rgb("#A0A0A0"),
    Status.SINGULAR: rgb(PURPLE),
    Status.UNSTABLE: rgb(VERMILLION),
    Status.NOT_CONVERGED: rgb(ORANGE),
}


@cache
def table() -> Image:
    """(256, 3) colours from low to high."""
    return np.asarray(255 * matplotlib.colormaps[COLOURS](np.linspace(0, 1, 256))[:, :3] + 0.5, np.uint8)


def colours_of(values: NDArray[np.float64], low: float, high: float) -> Image:
    """(..., 3) of values in the unit of the range; grey where they are NaN."""
    part = (values - low) / (high - low)
    index = np.clip(np.nan_to_num(part), 0.0, 1.0) * 255 + 0.5
    out = table()[index.astype(np.uint8)]
    out[np.isnan(values)] = GREY
    return np.asarray(out)


def plane_image(found: PlaneMap, limits: tuple[float, float]) -> Image:
    """(rows, columns, 4), rows along v: one pixel per pose, or several where poses are hatched."""
    if found.quantity == "status":
        rgb = np.empty((*found.values.shape, 3), np.uint8)
        for kind in Status:
            rgb[found.status == kind] = STATUS_COLOURS.get(kind, GREY)
    else:
        rgb = colours_of(found.shown, *limits)
    alpha = np.where(found.outside, 0, 255).astype(np.uint8)
    image = np.dstack([rgb, alpha])
    failed = found.failed
    if not failed.any():
        return image
    image = image.repeat(HATCHED, axis=0).repeat(HATCHED, axis=1)
    stripes = np.indices(image.shape[:2]).sum(axis=0) % PERIOD < 2
    image[stripes & failed.repeat(HATCHED, axis=0).repeat(HATCHED, axis=1), :3] = DARK
    return image
