"""Deflection against the direction of the force, in polar coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stiffmap.ui.plot.style import BLUE, MM, TOLERANCE, headline, length_unit, panel, paper, place_text


def polar_figure(
    diagrams: Sequence[xr.Dataset] | xr.Dataset,
    *,
    variable: str = "deflection_xy",
    tolerance: float | None = 0.25e-3,
) -> Figure:
    """One diagram per Dataset of `polar`: radius = deflection (mm), angle = direction of the force."""
    many = [diagrams] if isinstance(diagrams, xr.Dataset) else list(diagrams)
    with paper(max(2.6 * len(many) + 0.4, 4.0), 3.3) as figure:
        factor = length_unit(max(float(np.nanmax(p[variable].values, initial=0.0)) for p in many))[1]
        for i, pol in enumerate(many):
            ax: Any = figure.add_subplot(1, len(many), i + 1, projection="polar")
            draw_polar(ax, pol, variable, tolerance, factor)
            ax.set_title(f"{panel(i, len(many))} {position_text(pol)}".strip())
        machine = many[0].attrs["machine"]
        unit = length_unit(max(float(np.nanmax(p[variable].values, initial=0.0)) for p in many))[0]
        headline(figure, f"{machine}: deflection, {unit}, under {force_text(many[0])}")
    return figure


def draw_polar(ax: Any, pol: xr.Dataset, variable: str, tolerance: float | None, factor: float = MM) -> None:
    """One diagram on a polar axis; gaps where a direction failed."""
    angle, value = (np.append(pol[n].values, pol[n].values[0]) for n in ("angle", variable))
    ax.plot(angle, factor * value, color=BLUE, label=in_words(variable))
    if tolerance is not None:
        ring = np.linspace(0, 2 * np.pi, 181)
        ax.plot(ring, np.full(181, factor * tolerance), color=TOLERANCE, lw=1, ls="--",
                label=f"tolerance {MM * tolerance:g} mm")  # fmt: skip
    ax.set_ylim(0, None)
    ax.set_rlabel_position(100)
    ax.yaxis.get_major_locator().base.set_params(nbins=4)
    ax.tick_params(pad=1)
    for text in ax.get_yticklabels():
        text.set_bbox({"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 0.5})


def in_words(variable: str) -> str:
    """What a deflection variable means."""
    plane = variable.rpartition("_")[2]
    return f"deflection in the {plane} plane" if plane in ("xy", "xz", "yz") else "deflection"


def position_text(ds: xr.Dataset) -> str:
    """Position in mm."""
    return place_text(ds.position.values)


def force_text(ds: xr.Dataset) -> str:
    """The force of a polar diagram."""
    return f"a force of {float(ds.force):g}\u00a0N"
