"""The machine, with the named element lit."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from stiffmap.experiment.experiment import Floats
from stiffmap.identification.diagnosis.report.findings import Effect
from stiffmap.identification.diagnosis.report.result import Diagnosis
from stiffmap.solve.compiled import Role
from stiffmap.solve.machine import Machine
from stiffmap.ui.plot.elements import nodes_of
from stiffmap.ui.plot.scene import dots, draw_skeleton, finish, on, scene_axes
from stiffmap.ui.plot.skeleton import COINCIDENT, owners, standing
from stiffmap.ui.plot.style import new_figure

LIT, GREY = "#d62728", "0.65"


def place_figure(d: Diagnosis) -> Figure:
    """The declared machine at home in grey; legs of the named effects dark, their elements red."""
    machine = d.declared
    shape = standing(machine)
    figure = new_figure(4.6, 3.4)
    ax = scene_axes(figure, shape, None)
    legs = {leg for e in d.effects for leg in e.legs}
    dark = legs if len(legs) < len(machine.legs) else ()
    colours = {leg: "0.2" if leg in dark else GREY for leg in ("", *machine.legs)}
    draw_skeleton(ax, shape, colours, joints=False)
    for e in d.effects:
        points, pieces = lit(machine, shape.coordinates, e)
        for ends in pieces:
            ax.plot(*on(ax, ends), color=LIT, lw=4)
        dots(ax, points if len(points) else shape.tcp[None], 90, color=LIT)
    finish(ax)
    ax.set_axis_off()
    names = [
        f"{e.element.replace('actuator', 'drive')}{' of leg ' + ', '.join(e.legs) if e.legs else ''}"
        for e in d.effects
    ]
    figure.suptitle("; ".join(names)[:80] or machine.name, fontsize=10)
    return figure


def lit(machine: Machine, coordinates: Floats, e: Effect) -> tuple[Floats, list[Floats]]:
    """Points (n, 3) and pieces (2, 3) of the element that an effect names; nothing for instruments and loads."""
    core = machine.compiled
    position, _ = core.frames(coordinates)
    owner, found = owners(core), list(nodes_of(core, e.element, e.legs))
    pieces = [
        position[[parent, i]]
        for i in found
        for parent, c in (core.nodes[i],)
        if core.names.roles[c] == Role.SPRING and parent > 0 and owner[i]
        if np.linalg.norm(position[i] - position[parent]) > COINCIDENT
    ]
    return np.unique(np.round(position[found], 9), axis=0), pieces
