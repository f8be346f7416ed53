"""The machine, with the named element lit."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from stiffmap.experiment.experiment import Floats
from stiffmap.identification.diagnosis.report.findings import Effect, Findings
from stiffmap.solve.compiled import Role, Status
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.machine import Machine
from stiffmap.ui.plot.scene import draw_body, finish, flat_marks, on, scene_axes, tool
from stiffmap.ui.plot.skeleton import owners, skeleton

LIT, GREY = "#d62728", "0.65"


def place_figure(d: Findings) -> Figure:
    """The declared machine at home in grey; legs of the named effects dark, their elements red."""
    machine = d.declared
    k = inverse_kinematics(machine, machine.description.home.p)
    figure = Figure(figsize=(4.6, 3.4), layout="constrained")
    if int(k.status) != Status.CONVERGED:
        return figure
    shape = skeleton(machine, k.coordinates)
    ax: Any = scene_axes(figure, shape, None)
    legs = {leg for e in d.effects for leg in e.legs}
    for _, ends in shape.guides:
        ax.plot(*on(ax, ends), color="0.85", lw=4, solid_capstyle="butt")
    for leg, ends in shape.links:
        named = leg in legs and len(legs) < len(machine.legs)
        ax.plot(*on(ax, ends), color="0.2" if named else GREY, lw=2.4 if named else 1.6)
    if len(shape.platform):
        draw_body(ax, shape.platform)
        tool(ax, shape)
    marks = flat_marks(ax)
    for e in d.effects:
        points, ends_of = lit(machine, k.coordinates, e)
        for ends in ends_of:
            ax.plot(*on(ax, ends), color=LIT, lw=4)
        ax.scatter(*on(ax, points if len(points) else shape.tcp[None]), s=90, color=LIT, **marks)
    ax.scatter(*on(ax, shape.tcp), marker="*", s=90, color="#E69F00", edgecolor="black", lw=0.5, **marks)
    finish(ax, shape)
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
    owner = owners(core)
    wanted = e.element.split(".")
    points, pieces = [], []
    for i, (parent, c) in enumerate(core.nodes):
        if c < 0:
            continue
        parts = core.names.coordinates[c].split(".")
        if (e.legs and parts[0] not in e.legs) or not any(
            parts[k : k + len(wanted)] == wanted for k in range(len(parts))
        ):
            continue
        points.append(position[i])
        spring = core.names.roles[c] == Role.SPRING
        if spring and parent > 0 and owner[i] and np.linalg.norm(position[i] - position[parent]) > 1e-9:
            pieces.append(position[[parent, i]])
    unique = np.unique(np.round(np.array(points).reshape(-1, 3), 9), axis=0)
    return unique, pieces
