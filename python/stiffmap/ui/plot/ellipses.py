"""Where the tool goes when the force turns: ellipses of deflections."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stiffmap.ui.plot.polars import force_text, position_text
from stiffmap.ui.plot.style import BLUE, MM, TOLERANCE, headline, panel, paper


def ellipse_figure(
    diagrams: Sequence[xr.Dataset] | xr.Dataset, *, plane: str = "xy", tolerance: float | None = 0.25e-3
) -> Figure:
    """Displacement of the TCP in the plane (mm) as the force turns; one panel per Dataset of `polar`."""
    many = [diagrams] if isinstance(diagrams, xr.Dataset) else list(diagrams)
    with paper(max(2.5 * len(many) + 0.4, 4.0), 3.2) as figure:
        axes = figure.subplots(1, len(many), squeeze=False)[0]
        for i, (ax, pol) in enumerate(zip(axes, many, strict=True)):
            draw_ellipse(ax, pol, plane, tolerance)
            ax.set_title(f"{panel(i, len(many))} {position_text(pol)}".strip())
        machine = many[0].attrs["machine"]
        headline(figure, f"{machine}: displacement under {force_text(many[0])}")
    return figure


def draw_ellipse(ax: Axes, pol: xr.Dataset, plane: str, tolerance: float | None) -> None:
    """One ellipse with equal axes; a dot marks the displacement under a force along the first axis."""
    names = [f"d{n}" for n in plane]
    u, v = (MM * pol.displacement.sel(component=n).values for n in names)
    ax.plot(np.append(u, u[0]), np.append(v, v[0]), color=BLUE, label="displacement")
    ax.plot(u[:1], v[:1], "o", ms=4, color=BLUE, label=f"force along +{plane[0]}")
    if tolerance is not None:
        ring, r = np.linspace(0, 2 * np.pi, 181), MM * tolerance
        ax.plot(
            r * np.cos(ring), r * np.sin(ring), color=TOLERANCE, lw=1, ls="--", label=f"tolerance {r:g} mm"
        )
    ax.axhline(0, color="0.7", lw=0.5, zorder=0)
    ax.axvline(0, color="0.7", lw=0.5, zorder=0)
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_xlabel(f"{names[0]}, mm")
    ax.set_ylabel(f"{names[1]}, mm")
