"""The grid of a map where none is given: the machine's own workspace."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.solve.machine import Machine

POINTS = 51
"""Along each edge of a plane."""


def grid_of(machine: Machine, given: Mapping[str, ArrayLike | None], points: int = POINTS) -> dict[str, Any]:
    """Axes (m) x, y, z: those given, the others over the workspace.

    A coordinate that is not commanded has one value, its home; planes lie at three heights where none is named. StiffmapError where an
    axis is wanted of a machine without a workspace.
    """
    out: dict[str, Any] = {a: v for a, v in given.items() if v is not None}
    if len(out) == 3:
        return out
    low, high = machine.workspace
    named = bool(out)
    task = machine.description.task
    for i, a in enumerate("xyz"):
        if a in out:
            continue
        if task and a not in task:
            out[a] = [float(machine.description.home.p[i])]
        elif a == "z" and not named:
            middle = 0.0 if low[2] < 0 < high[2] else (low[2] + high[2]) / 2
            out[a] = [low[2], middle, high[2]]
        else:
            out[a] = np.linspace(low[i], high[i], max(points, 0))
    if task and np.size(out["x"]) == np.size(out["y"]) == 1 and not named:
        out["z"] = np.linspace(low[2], high[2], max(points, 0))  # only the height is commanded
    return {a: out[a] for a in "xyz"}
