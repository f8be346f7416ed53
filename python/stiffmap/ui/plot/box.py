"""The largest box in sections of the workspace about it, through the corner that comes nearest to a limit."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.solve.machine import Machine
from stiffmap.ui.plot.style import BLACK, BLUE, MM, paper
from stiffmap.ui.plot.workspace import edges, name_axes, paint, planes_of, section
from stiffmap.workspace.performance.box.box import LargestBox
from stiffmap.workspace.performance.box.inside import REACH
from stiffmap.workspace.performance.box.proof import BOX

NODES = 80
AROUND = 0.85
"""Of the box's edges: how far about its centre the sections reach."""
THIN = 1e-6


def box_figure(machine: Machine, box: LargestBox, nodes: int = NODES) -> Figure:
    """Sections in the box's own axes, coloured by what excludes a pose; the box, and the machine file's workspace.

    Raises StiffmapError where no box was found or it is a line.
    """
    if not box.edge > 0:
        raise StiffmapError(f"{machine.name}: no box was found, so there is none to draw")
    moves = [i for i in range(3) if box.edges[i] > THIN * box.edges.max()]
    planes = planes_of(moves)
    if not planes:
        raise StiffmapError(f"{machine.name}: the largest box is a line, so there is no section to draw")
    low, high = box.corners
    at = _tightest(box)
    declared = np.allclose(box.orientation, np.eye(3))
    marks = "xyz" if declared else ("x′", "y′", "z′")
    ends = f"; limited by {', '.join(box.limited_by)}" if box.limited_by else ""
    sure = "proven" if box.proven else "sampled"
    title = (
        f"{machine.name}: largest box {_edges(box)} mm ({sure}), none of {MM * box.edge_upper:.2f} mm{ends}"
    )
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


def _edges(box: LargestBox) -> str:
    shown = [f"{MM * e:.2f}" for e in box.edges if e > THIN * box.edges.max()]
    return " × ".join(shown) if len(set(shown)) > 1 else shown[0]


def _tightest(box: LargestBox) -> Floats:
    """(3,) the corner, in the box's axes, that comes nearest to a limit, relative to the limit's size."""
    corners = box.corners.mean(axis=0) + BOX * box.edges / 2
    _, limits = box.bounds.at(corners @ box.orientation.T)
    room = [(limit.most - limit.value) / max(abs(limit.most), 1e-9) for limit in limits]
    return np.asarray(corners[int(np.argmin(np.min(room, axis=0)))] if room else corners[0])
