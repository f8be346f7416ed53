"""Deflection against the size of the force."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stiffmap.solve.status import Status
from stiffmap.ui.plot.polars import in_words, position_text
from stiffmap.ui.plot.style import BLACK, CYCLE, MM, headline, line_look, panel, paper


def sweep_figure(
    panels: Mapping[str, xr.Dataset] | Sequence[Mapping[str, xr.Dataset]],
    *,
    variable: str = "deflection_xy",
    tolerance: float | None = 0.25e-3,
) -> Figure:
    """Lines of force against deflection (mm), by label; several panels where several mappings are given.

    Unstable equilibria are drawn as open circles; failed ones leave a gap and a cross on the axis.
    """
    many = [panels] if isinstance(panels, Mapping) else list(panels)
    with paper(max(2.3 * len(many) + 0.6, 4.0), 3.1) as figure:
        axes = figure.subplots(1, len(many), squeeze=False)[0]
        for i, (ax, lines) in enumerate(zip(axes, many, strict=True)):
            draw_sweeps(ax, lines, variable, tolerance)
            ax.set_title(f"{panel(i, len(many))} {position_text(next(iter(lines.values())))}".strip())
        axes[0].set_ylabel(f"{in_words(variable)}, mm")
        machine = next(iter(many[0].values())).attrs["machine"]
        headline(figure, f"{machine}: deflection against force")
    return figure


def draw_sweeps(ax: Axes, lines: Mapping[str, xr.Dataset], variable: str, tolerance: float | None) -> None:
    """The sweeps of one panel."""
    for i, (label, swp) in enumerate(lines.items()):
        colour = CYCLE[i % len(CYCLE)]
        stable = swp.status == Status.CONVERGED
        force, value = swp.force, MM * swp[variable]
        ax.plot(force, value.where(stable), label=label, **line_look(i))
        unstable = (swp.status == Status.UNSTABLE) & np.isfinite(value)
        if unstable.any():
            ax.plot(
                force[unstable],
                value[unstable],
                "o",
                mfc="none",
                ms=3.5,
                color=colour,
                label=f"{label}: unstable",
            )
        lost = ~np.isfinite(value)
        if lost.any():
            ax.plot(
                force[lost],
                np.zeros(int(lost.sum())),
                "x",
                ms=4,
                color=colour,
                label=f"{label}: no equilibrium",
            )
    if tolerance is not None:
        ax.axhline(MM * tolerance, color=BLACK, lw=1, ls=":", label=f"tolerance {MM * tolerance:g} mm")
    ax.set_xlabel("force, N")
    ax.set_ylim(0 if min(float(s[variable].min()) for s in lines.values()) >= 0 else None, None)
    ax.margins(x=0)
