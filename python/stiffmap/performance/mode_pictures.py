"""Mode shapes drawn over the machine at rest; frames of one swing for an animation."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from stiffmap.broadcasting import Floats
from stiffmap.errors import StiffmapError
from stiffmap.machine import Machine
from stiffmap.performance.frequencies import NaturalFrequencies, natural_frequencies
from stiffmap.plot.skeleton import skeleton
from stiffmap.plot.style import BLUE, MM, VERMILLION, new_figure, paper_style

SWING = 0.08
"""Of the machine's extent: how far the point that moves most is drawn from its place."""


def mode_figure(
    machine: Machine, position: ArrayLike, *, modes: int = 3, phase: float = np.pi / 2, **options: object
) -> Figure:
    """The first `modes` modes at a pose (3,) m, each at `phase` of its swing (rad; pi/2: farthest), exaggerated.

    `options` go to `natural_frequencies`. One picture per phase from 0 to 2 pi is an animation. Raises
    StiffmapError for bad input and for a pose without modes.
    """
    w = natural_frequencies(machine, position, modes=modes, **options)  # type: ignore[arg-type]
    count = int(np.isfinite(w.frequency).sum())
    if w.frequency.ndim != 1 or not count:
        raise StiffmapError(f"{machine.name}: no mode at {np.asarray(position).tolist()} m (one pose (3,))")
    rest = skeleton(machine, w.coordinates)
    points = np.concatenate([line for _, line in rest.links])
    centre, half = (points.max(0) + points.min(0)) / 2, np.ptp(points, axis=0).max() / 2
    with paper_style():
        figure = new_figure(3.3 * count, 3.6)
        for i in range(count):
            axes = figure.add_subplot(1, count, i + 1, projection="3d")
            _lines(
                axes, [line for _, line in rest.links], {"color": "0.45", "linewidth": 0.8, "linestyle": "--"}
            )
            moved = skeleton(machine, swung(machine, w, i, phase, SWING * 2 * half)).links
            _lines(axes, [line for _, line in moved], {"color": BLUE, "linewidth": 1.2})
            axes.plot(*(MM * rest.tcp)[:, None], "o", color=VERMILLION, markersize=4)
            for name, c in zip("xyz", centre, strict=True):
                getattr(axes, f"set_{name}lim")(MM * (c - half), MM * (c + half))
                getattr(axes, f"set_{name}label")(f"{name}, mm")
                getattr(axes, f"{name}axis").set_major_locator(MaxNLocator(4))
            axes.grid(False)
            axes.set_title(f"mode {i + 1}: {w.frequency[i]:.4g} Hz")
        figure.suptitle(f"{machine.name}: shapes exaggerated, dashed at rest, dot: TCP")
    return figure


def swung(machine: Machine, w: NaturalFrequencies, mode: int, phase: float, size: float) -> Floats:
    """(coordinates,) of a mode at a phase, the frame that moves most by `size` m at the farthest."""
    small = 1e-6 / max(float(np.abs(w.shape[mode]).max()), 1e-300)
    at, there = (machine.compiled.frames(w.coordinates + s * w.shape[mode])[0] for s in (0.0, small))
    most = float(np.linalg.norm(there - at, axis=1).max()) / small
    return np.asarray(w.coordinates + size / most * np.sin(phase) * w.shape[mode])


def _lines(axes, lines: list[Floats], style: dict[str, object]) -> None:  # type: ignore[no-untyped-def]
    for line in lines:
        axes.plot(*(MM * line.T), **style)
