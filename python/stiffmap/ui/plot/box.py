"""Sections of the workspace through its middle, and what it ends by; the largest box in sections about it, through the corner
that comes nearest to a limit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.solve.machine import Machine
from stiffmap.ui.plot.style import BLACK, BLUE, GREEN, MM, ORANGE, PURPLE, SKY, VERMILLION, paper
from stiffmap.workspace.performance.box.box import LargestBox
from stiffmap.workspace.performance.box.inside import REACH
from stiffmap.workspace.performance.box.proof import BOX
from stiffmap.workspace.performance.box.workspace import Workspace

AROUND = 0.85  # of the box's edges: how far about its centre the sections reach
THIN = 1e-6
KINDS = (
    (REACH, "0.9", "out of reach"),
    ("range of", ORANGE, "range of a drive"),
    ("joint limit", PURPLE, "limit of a joint"),
    ("transmission", VERMILLION, "transmission"),
    ("cube factor", VERMILLION, "transmission"),
    ("singularity", BLACK, "at or beyond a singularity"),
    ("clearance", GREEN, "clearance of bars"),
    ("deflection", GREEN, "deflection"),
)
"""How a limit's name begins, its colour and its words; where several are broken, the first of these counts."""


def workspace_figure(machine: Machine, found: Workspace, nodes: int = 90) -> Figure:
    """Sections xy, xz, yz through the middle of what was found; the box that the machine file declares.

    Raises StiffmapError where nothing was found or the workspace is a line.
    """
    if not np.isfinite(found.box).all() or found.dimension < 2:
        raise StiffmapError(f"{machine.name}: no section of the workspace to draw")
    size = found.region[1] - found.region[0]
    planes = planes_of(size > 0)
    middle = found.box.mean(axis=0)
    low, high = machine.workspace
    unit = {2: "m²", 3: "m³"}[found.dimension]
    title = f"{machine.name}: workspace, {found.volume:.4g} ± {found.error:.1g} {unit}"
    with paper(max(3.0 * len(planes) + 0.4, 4.0), 3.9, title, most=1 + len(planes)) as figure:
        for axes, (a, b) in zip(figure.subplots(1, len(planes), squeeze=False)[0], planes, strict=True):
            u, v = (np.linspace(float(found.region[0, i]), float(found.region[1, i]), nodes) for i in (a, b))
            judged = found.at(section(middle, a, b, u, v))
            paint(axes, u, v, judged.inside, judged.causes())
            axes.add_patch(edges(low, high, a, b, edgecolor=BLACK, label="box of the machine file"))
            name_axes(axes, a, b, middle)
    return figure


def planes_of(moves: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Pairs of the axes along which the machine moves; moves (3,)."""
    return [(a, b) for a, b in ((0, 1), (0, 2), (1, 2)) if moves[a] and moves[b]]


def section(at: Floats, a: int, b: int, u: Floats, v: Floats) -> Floats:
    """(len(u)·len(v), 3) m: points through `at` (3,), axis `a` over `u` and axis `b` over `v`."""
    points = np.tile(at, (len(u) * len(v), 1))
    points[:, a], points[:, b] = (g.ravel() for g in np.meshgrid(u, v, indexing="ij"))
    return points


def name_axes(axes: Axes, a: int, b: int, at: Floats, marks: Sequence[str] = "xyz") -> None:
    """Which axes a section shows, and where it lies on the third."""
    axes.set(xlabel=f"{marks[a]}, mm", ylabel=f"{marks[b]}, mm")
    (rest,) = {0, 1, 2} - {a, b}
    axes.set(title=f"{marks[rest]} = {round(MM * at[rest]) + 0:d} mm", aspect="equal")


def edges(low: Floats, high: Floats, a: int, b: int, **look: Any) -> Rectangle:
    """A box between two corners (3,) m, as a section shows it."""
    return Rectangle((MM * low[a], MM * low[b]), *(MM * (high - low)[[a, b]]), fill=False, **look)


def paint(
    axes: Axes, u: Floats, v: Floats, inside: NDArray[np.bool_], broken: Mapping[str, NDArray[np.bool_]]
) -> None:
    """Poses on the nodes of u and v (m), first axis u, coloured by what excludes them."""
    kind, seen = np.where(inside, 0, 1), {"inside": SKY}
    for number, (begin, colour, words) in reversed(list(enumerate(KINDS, 1))):
        for name, bad in broken.items():
            if name.startswith(begin):
                kind[bad & ~inside] = number
                if (bad & ~inside).any():
                    seen[words] = colour
    shown = ListedColormap([SKY, *(colour for _, colour, _ in KINDS)])
    axes.pcolormesh(
        MM * u, MM * v, kind.reshape(len(u), len(v)).T, cmap=shown, vmin=-0.5, vmax=len(KINDS) + 0.5,
        shading="nearest", rasterized=True,
    )  # fmt: skip
    for words, colour in seen.items():
        axes.fill([], [], facecolor=colour, edgecolor="0.6", label=words)


def box_figure(machine: Machine, box: LargestBox, nodes: int = 80) -> Figure:
    """Sections in the box's own axes, coloured by what excludes a pose; the box, and the machine file's workspace.

    Raises StiffmapError where no box was found or it is a line.
    """
    if not box.edge > 0:
        raise StiffmapError(f"{machine.name}: no box was found, so there is none to draw")
    moves = box.edges > THIN * box.edges.max()
    planes = planes_of(moves)
    if not planes:
        raise StiffmapError(f"{machine.name}: the largest box is a line, so there is no section to draw")
    low, high = box.corners
    corners = box.corners.mean(axis=0) + BOX * box.edges / 2
    _, limits = box.bounds.at(corners @ box.orientation.T)
    room = [(limit.most - limit.value) / max(abs(limit.most), 1e-9) for limit in limits]
    at = np.asarray(corners[int(np.argmin(np.min(room, axis=0)))] if room else corners[0])
    declared = np.allclose(box.orientation, np.eye(3))
    marks = "xyz" if declared else ("x′", "y′", "z′")
    shown = [f"{MM * e:.2f}" for e in box.edges[moves]]
    size = " × ".join(shown) if len(set(shown)) > 1 else shown[0]
    ends = f"; limited by {', '.join(box.limited_by)}" if box.limited_by else ""
    sure = "proven" if box.proven else "sampled"
    title = f"{machine.name}: largest box {size} mm ({sure}), none of {MM * box.edge_upper:.2f} mm{ends}"
    with paper(max(3.1 * len(planes) + 0.4, 4.4), 4.1, title, most=4) as figure:
        for axes, (a, b) in zip(figure.subplots(1, len(planes), squeeze=False)[0], planes, strict=True):
            middle, reach = (low + high) / 2, AROUND * (high - low)
            u, v = (np.linspace(middle[i] - reach[i], middle[i] + reach[i], nodes) for i in (a, b))
            closed, limits = box.bounds.at(section(at, a, b, u, v) @ box.orientation.T)
            broken = {limit.name: closed & ~(limit.value <= limit.most) for limit in limits}
            inside = closed & ~np.any([*broken.values(), np.zeros_like(closed)], axis=0)
            paint(axes, u, v, inside, broken | {REACH: ~closed})
            axes.add_patch(edges(low, high, a, b, edgecolor=BLUE, linewidth=1.6, label="largest box"))
            if declared:
                box_there, words = machine.workspace, "box of the machine file"
                space = edges(box_there[0], box_there[1], a, b, edgecolor=BLACK, linestyle=":", label=words)
                axes.add_patch(space)
            corner = "its corner nearest to a limit"
            axes.plot(*(MM * at[[a, b]]), "o", color=BLUE, markersize=5, clip_on=False, label=corner)
            name_axes(axes, a, b, at, marks)
            axes.set_xlim(MM * u[0], MM * u[-1])
            axes.set_ylim(MM * v[0], MM * v[-1])
    return figure
