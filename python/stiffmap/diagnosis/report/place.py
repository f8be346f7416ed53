"""The machine, with the named element lit."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from stiffmap.compiled import Role, Status
from stiffmap.diagnosis.report.findings import Effect, Findings
from stiffmap.experiment.experiment import Floats
from stiffmap.kinematics import inverse_kinematics
from stiffmap.machine import Machine
from stiffmap.plot.machines import look_from
from stiffmap.plot.skeleton import owners, skeleton

LIT, GREY, MM = "#d62728", "0.65", 1e3


def place_figure(d: Findings) -> Figure:
    """The declared machine at home in grey; legs of the named effects dark, their elements red."""
    machine = d.declared
    k = inverse_kinematics(machine, machine.description.home.p)
    figure = Figure(figsize=(4.6, 3.6))
    ax: Any = figure.add_axes((0.0, 0.02, 1.0, 0.9), projection="3d")
    if int(k.status) != Status.CONVERGED:
        ax.set_axis_off()
        return figure
    shape = skeleton(machine, k.coordinates)
    legs = {leg for e in d.effects for leg in e.legs}
    for _, ends in shape.guides:
        ax.plot(*(MM * ends.T), color="0.85", lw=4, solid_capstyle="butt")
    for leg, ends in shape.links:
        named = leg in legs and len(legs) < len(machine.legs)
        ax.plot(*(MM * ends.T), color="0.2" if named else GREY, lw=2.4 if named else 1.6)
    for e in d.effects:
        points, ends_of = lit(machine, k.coordinates, e)
        for ends in ends_of:
            ax.plot(*(MM * ends.T), color=LIT, lw=4)
        if not len(points):
            points = shape.tcp[None]
        ax.scatter(*(MM * points.T), s=90, color=LIT, depthshade=False, zorder=10)
    ax.scatter(
        *(MM * shape.tcp), marker="*", s=90, color="#E69F00", edgecolor="black", lw=0.5, depthshade=False
    )
    look_from(ax, shape)
    ax.set_aspect("equal")
    ax.set_box_aspect(None, zoom=1.25)
    ax.set_axis_off()
    names = [
        f"{e.element.replace('actuator', 'drive')}{' of leg ' + ', '.join(e.legs) if e.legs else ''}"
        for e in d.effects
    ]
    figure.suptitle("; ".join(names)[:80] or machine.name, fontsize=10, y=0.98)
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
