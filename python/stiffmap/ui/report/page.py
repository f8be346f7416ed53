"""A page with the loaded machine that turns under the mouse; one file, no server, no network."""

from __future__ import annotations

import json
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats
from stiffmap.common.number_text import length_text, length_unit, vector_text
from stiffmap.common.outputs import write_text
from stiffmap.solve.budget import deflection_budget
from stiffmap.solve.machine import Machine
from stiffmap.ui.plot.loaded import LoadedShape, loaded_shape
from stiffmap.ui.plot.style import leg_colours
from stiffmap.ui.report.sheet import render


def write_page(
    machine: Machine,
    path: str | PathLike[str],
    position: ArrayLike | None = None,
    wrench: ArrayLike = (0.0, 0.0, -300.0, 0.0, 0.0, 0.0),
    *,
    rotation: ArrayLike | None = None,
) -> Path:
    """Write the page; raises FileError where it cannot be written, StiffmapError for a failed pose."""
    shape = loaded_shape(machine, position, wrench, rotation=rotation)
    budget = deflection_budget(machine, position, wrench, rotation=rotation)
    size = sum(v * v for v in shape.displacement[:3]) ** 0.5
    unit, scale, decimals = length_unit(size)
    text = render(
        "machine.html",
        name=machine.name,
        title=machine.description.title,
        position=vector_text(1e3 * budget.position),
        force=vector_text(budget.wrench[:3]),
        size=length_text(size),
        unit=unit,
        factor=shape.factor,
        budget=[(n, f"{scale * size * s:.{decimals}f}", 100 * s) for n, _, s in budget.ranked()],
        data=json.dumps(scene(shape, machine.legs)),
    )
    return write_text(path, text)


def scene(shape: LoadedShape, legs: tuple[str, ...]) -> dict[str, object]:
    """Lines and points at rest and under load (mm), for the page's script."""
    colours, rest, loaded = leg_colours(legs), shape.rest, shape.loaded
    links = [
        {"leg": leg, "colour": colours[leg], "rest": _mm(a), "loaded": _mm(b)}
        for leg, a, b in zip(rest.legs, rest.links, loaded.links, strict=True)
    ]
    points = ("actuators", "passive", "tcp")
    return {
        "links": links,
        "guides": list(map(_mm, rest.guides)),
        **{n: {"rest": _mm(getattr(rest, n)), "loaded": _mm(getattr(loaded, n))} for n in points},
        "force": list(map(float, shape.force)),
        "factor": shape.factor,
    }


def _mm(points: Floats) -> list[list[float]]:
    return [[float(f"{1e3 * v:.7g}") for v in p] for p in np.atleast_2d(points)]
