"""Pictures of vibration: mode shapes over the machine at rest and frames of one swing; stability lobes, frequency responses."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Line3D
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.solve.machine import Machine
from stiffmap.ui.plot.skeleton import skeleton
from stiffmap.ui.plot.style import BLACK, BLUE, COLOURS, MM, UM, VERMILLION, legend_below, line_look, paper
from stiffmap.workspace.performance.motion.inertia import NaturalFrequencies, natural_frequencies

FRAMES = 9  # from one end of a swing to the other
SWING = 0.08  # of the machine's extent: how far the point that moves most is drawn from its place


def mode_figure(machine: Machine, position: ArrayLike, *, modes: int = 3, **options: object) -> Figure:
    """The first `modes` modes at a pose (3,) m, each where its swing is farthest, exaggerated.

    `options` go to `natural_frequencies`. Raises StiffmapError for bad input and for a pose without modes.
    """
    scene = _Scene(machine, position, modes, options)
    scene.swing(np.pi / 2)
    return scene.figure


def mode_frames(
    machine: Machine, position: ArrayLike, *, modes: int = 3, count: int = FRAMES, **options: object
) -> Iterator[Figure]:
    """Frames of a swing from one end to the other: the same figure each time, to be drawn before the next.

    As `mode_figure`; `count` frames.
    """
    scene = _Scene(machine, position, modes, options)
    for phase in np.linspace(-np.pi / 2, np.pi / 2, count):
        scene.swing(phase)
        yield scene.figure
        scene.figure.set_layout_engine(None)  # as the first frame has it


class _Scene:
    """A panel per mode: the machine at rest, and lines that swing."""

    def __init__(self, machine: Machine, position: ArrayLike, modes: int, options: dict[str, object]) -> None:
        self.machine = machine
        self.w = w = natural_frequencies(machine, position, modes=modes, **options)  # type: ignore[arg-type]
        count = int(np.isfinite(w.frequency).sum())
        if w.frequency.ndim != 1 or not count:
            at = np.asarray(position).tolist()
            raise StiffmapError(f"{machine.name}: no mode at {at} m (one pose (3,))")
        rest = skeleton(machine, w.coordinates)
        lines = [line for _, line in rest.bars]
        points = np.concatenate(lines)
        centre, self.half = (points.max(0) + points.min(0)) / 2, np.ptp(points, axis=0).max() / 2
        self.moving: list[list[Line3D]] = []
        with paper(3.3 * count, 3.6, most=0) as self.figure:
            for i in range(count):
                axes = self.figure.add_subplot(1, count, i + 1, projection="3d")
                _lines(axes, lines, {"color": "0.45", "linewidth": 0.8, "linestyle": "--"})
                self.moving.append(_lines(axes, rest.links, {"color": BLUE, "linewidth": 1.2}))
                axes.plot(*(MM * rest.tcp)[:, None], "o", color=VERMILLION, markersize=4)
                for name, c in zip("xyz", centre, strict=True):
                    getattr(axes, f"set_{name}lim")(MM * (c - self.half), MM * (c + self.half))
                    getattr(axes, f"set_{name}label")(f"{name}, mm")
                    getattr(axes, f"{name}axis").set_major_locator(MaxNLocator(4))
                axes.grid(False)
                axes.set_title(f"mode {i + 1}: {w.frequency[i]:.4g} Hz")
            self.figure.suptitle(f"{machine.name}: shapes exaggerated, dashed at rest, dot: TCP")

    def swing(self, phase: float) -> None:
        """Moves the lines to a phase."""
        for i, drawn in enumerate(self.moving):
            at = swung(self.machine, self.w, i, phase, SWING * 2 * self.half)
            for artist, line in zip(drawn, skeleton(self.machine, at).links, strict=True):
                artist.set_data_3d(*(MM * line.T))


def swung(machine: Machine, w: NaturalFrequencies, mode: int, phase: float, size: float) -> Floats:
    """(coordinates,) of a mode at a phase, the frame that moves most by `size` m at the farthest."""
    small = 1e-6 / max(float(np.abs(w.shape[mode]).max()), 1e-300)
    at, there = (machine.compiled.frames(w.coordinates + s * w.shape[mode])[0] for s in (0.0, small))
    most = float(np.linalg.norm(there - at, axis=1).max()) / small
    return np.asarray(w.coordinates + size / most * np.sin(phase) * w.shape[mode])


def _lines(axes: Axes3D, lines: Iterable[Floats], style: dict[str, object]) -> list[Line3D]:
    return [axes.plot(*(MM * line.T), **style)[0] for line in lines]


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
