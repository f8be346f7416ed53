"""Pictures of vibration: stability lobes, frequency responses."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stiffmap.ui.plot.style import BLACK, BLUE, COLOURS, MM, UM, VERMILLION, legend_below, line_look, paper

RPM = 60 / (2 * np.pi)


def lobes_figure(lobes: xr.Dataset, title: str, speed: float, depth: float) -> Figure:
    """Stable depth (mm) over the speed of the spindle (rpm); the cut of the process as a point."""
    with paper(6.0, 4.0, f"{title}\ndamping {lobes.attrs['damping']}") as figure:
        ax = figure.add_subplot()
        s, d = RPM * lobes.speed.values, MM * lobes.depth.values
        if "multiplier" in lobes:
            mu = np.clip(lobes.multiplier.values.T, 0, 2)
            filled = ax.pcolormesh(
                s, d, mu, cmap=COLOURS + "_r", vmin=0.5, vmax=1.5, shading="nearest", rasterized=True
            )
            bar = figure.colorbar(filled, ax=ax, extend="both")
            bar.set_label("largest multiplier, above 1: chatter")
            if mu.min() < 1 < mu.max():
                ax.contour(s, d, mu, levels=[1.0], colors=[BLACK], linewidths=1.4)
                ax.plot([], [], color=BLACK, lw=1.4, label="border, semi-discretization")
        zero = np.where(np.isfinite(lobes.limit_zero_order), MM * lobes.limit_zero_order, np.nan)
        ax.plot(s, zero, color=VERMILLION, ls="--", lw=1, label="border, zero order")
        at = RPM * speed, MM * depth
        near = np.clip(at[0], s[0], s[-1]), min(at[1], d[-1])
        beyond = "" if np.allclose(at, near) else ", beyond these axes"
        ax.plot(*near, "o", mfc="white", mec=BLUE, mew=1.5, clip_on=False, zorder=5,
                label=f"the process: {at[0]:.5g} rpm, {at[1]:.3g} mm{beyond}")  # fmt: skip
        ax.margins(0)
        ax.set_xlim(s[0], s[-1])
        ax.set_ylim(0, d[-1])
        ax.set(xlabel="speed of the spindle, rpm", ylabel="depth along the tool, mm")
    return figure


def response_figure(responses: Mapping[str, xr.DataArray]) -> Figure:
    """Size of the receptances (µm/N) along base axes over the frequency, a panel for each axis."""
    with paper(8.0, 3.0, "Frequency response at the tool", most=0) as figure:
        panels = figure.subplots(1, 3, sharey=True)
        for ax, axis in zip(panels, "xyz", strict=True):
            for i, (label, H) in enumerate(responses.items()):
                own = np.abs(H.sel(response=axis, force=f"f{axis}"))
                ax.semilogy(H.frequency, UM * own, label=label, **line_look(i))
            ax.set(title=f"along {axis}", xlabel="frequency, Hz")
        panels[0].set_ylabel("receptance, µm/N")
        if len(responses) > 1:
            legend_below(figure)
    return figure
