"""Mode shapes drawn over the machine at rest; frames of one swing for an animation."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Line3D
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.solve.machine import Machine
from stiffmap.ui.plot.skeleton import skeleton
from stiffmap.ui.plot.style import BLUE, MM, VERMILLION, new_figure, paper_style
from stiffmap.workspace.performance.motion.inertia import NaturalFrequencies, natural_frequencies

FRAMES = 9
"""From one end of a swing to the other."""
SWING = 0.08
"""Of the machine's extent: how far the point that moves most is drawn from its place."""


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
    """Frames of an animation, one whole swing and back: the same figure each time, to be drawn before the next.

    As `mode_figure`; `count` frames from one end of the swing to the other.
    """
    scene = _Scene(machine, position, modes, options)
    there = np.linspace(-np.pi / 2, np.pi / 2, count)
    for phase in (*there, *there[-2:0:-1]):
        scene.swing(phase)
        yield scene.figure
        scene.figure.set_layout_engine("none")  # as the first frame has it


class _Scene:
    """A panel per mode: the machine at rest, and lines that swing."""

    def __init__(self, machine: Machine, position: ArrayLike, modes: int, options: dict[str, object]) -> None:
        self.machine = machine
        self.w = w = natural_frequencies(machine, position, modes=modes, **options)  # type: ignore[arg-type]
        count = int(np.isfinite(w.frequency).sum())
        if w.frequency.ndim != 1 or not count:
            raise StiffmapError(
                f"{machine.name}: no mode at {np.asarray(position).tolist()} m (one pose (3,))"
            )
        rest = skeleton(machine, w.coordinates)
        lines = [line for _, line in rest.bars]
        points = np.concatenate(lines)
        centre, self.half = (points.max(0) + points.min(0)) / 2, np.ptp(points, axis=0).max() / 2
        self.moving: list[list[Line3D]] = []
        with paper_style():
            self.figure = new_figure(3.3 * count, 3.6)
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
