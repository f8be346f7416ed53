"""The worst pose of a map, and where its deflection comes from."""

from __future__ import annotations

from typing import Any

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.model.description.sources import in_words as source_words
from stiffmap.solve.budget import deflection_budget
from stiffmap.solve.machine import Machine
from stiffmap.ui.cli.inputs import MM

NAMED = 3
"""Elements that the sentence names."""


def worst_pose(machine: Machine, ds: Any, gravity: Any) -> dict[str, Any] | None:
    """The largest deflection of the map: load, position (m), deflection (m), shares of the elements and of their sources.

    The load is a case of the map, or the force that turned, in its worst direction there. None where no pose has an
    answer, or its deflection none to share.
    """
    found = [w for w in (_of_cases(ds), _of_directions(ds)) if w is not None]
    if not found:
        return None
    size, load, p, wrench = max(found, key=lambda w: w[0])
    try:
        budget = deflection_budget(machine, p, wrench, gravity=gravity)
    except StiffmapError:
        return None
    return {
        "case": load,
        "position": p,
        "wrench": [float(v) for v in wrench],
        "deflection": size,
        "shares": {n: s for n, _, s in budget.ranked()},
        "sources": budget.by_source,
    }


Worst = tuple[float, str, list[float], Any]
"""Deflection (m), load in words, position (m), wrench (6,)."""


def _of_cases(ds: Any) -> Worst | None:
    size = ds.deflection.transpose("z", "y", "x", "case").values
    if not np.isfinite(size).any():
        return None
    k, j, i, c = np.unravel_index(int(np.nanargmax(size)), size.shape)
    case = str(ds.case.values[c])
    return float(size[k, j, i, c]), case, _at(ds, k, j, i), ds.wrench.sel(case=case).values


def _of_directions(ds: Any) -> Worst | None:
    """Over the directions in which the map turned its force."""
    if "worst_deflection" not in ds:
        return None
    size = ds.worst_deflection.transpose("z", "y", "x").values
    if not np.isfinite(size).any():
        return None
    k, j, i = np.unravel_index(int(np.nanargmax(size)), size.shape)
    plane = ds.worst_direction.attrs["plane"]
    angle = float(ds.worst_direction.transpose("z", "y", "x").values[k, j, i])
    force = float(ds.attrs["turning_force_N"])
    wrench = np.zeros(6)
    wrench[["xyz".index(a) for a in plane]] = force * np.cos(angle), force * np.sin(angle)
    text = ", ".join(f"{v:.0f}" for v in wrench[:3])
    return (
        float(size[k, j, i]),
        f"({text}) N, the worst direction in the {plane} plane",
        _at(ds, k, j, i),
        wrench,
    )


def _at(ds: Any, k: Any, j: Any, i: Any) -> list[float]:
    return [float(ds[a].values[n]) for a, n in (("x", i), ("y", j), ("z", k))]


def in_words(worst: dict[str, Any]) -> str:
    """``worst pose of the map: 932.4 µm in space at (300, 300, -200) mm under …, of which 57 % z.foot …; 83 % of it …``."""
    at = ", ".join(f"{v / MM:.4g}" for v in worst["position"])
    parts = ", ".join(f"{100 * s:.0f} % {n}" for n, s in list(worst["shares"].items())[:NAMED])
    rests = source_words(worst["sources"])
    return (
        f"worst pose of the map: ({at}) mm, {1e6 * worst['deflection']:.1f} µm in space under {worst['case']}, of which "
        f"{parts}{'; ' + rests if rests else ''}"
    )
