"""The worst pose of a map, and where its deflection comes from."""

from __future__ import annotations

from typing import Any

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import length_text, percents, vector_text
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
    found = _worst(ds)
    if found is None:
        return None
    size, load, p, wrench = found
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


def _worst(ds: Any) -> tuple[float, str, list[float], Any] | None:
    """Deflection (m), load in words, position (m) and wrench (6,): of a case, or of the directions in which the force turned."""
    sizes: list[tuple[Any, tuple[str, ...]]] = [(ds.deflection, ("z", "y", "x", "case"))]
    sizes += [(ds.worst_deflection, ("z", "y", "x"))] if "worst_deflection" in ds else []
    largest = [v.isel(v.argmax(axes)) for v, axes in sizes if np.isfinite(v).any()]
    if not largest:
        return None
    there = max(largest, key=float)
    p = [float(there[a]) for a in "xyz"]
    if "case" in there.coords:
        case = str(there.case.values)
        return float(there), case, p, ds.wrench.sel(case=case).values
    plane, force = ds.worst_direction.attrs["plane"], ds.attrs["turning_force_N"]
    angle = float(ds.worst_direction.sel({a: there[a] for a in "xyz"}))
    wrench = np.zeros(6)
    wrench[["xyz".index(a) for a in plane]] = force * np.cos(angle), force * np.sin(angle)
    return (
        float(there),
        f"{vector_text(wrench[:3], 3)} N, the worst direction in the {plane} plane",
        p,
        wrench,
    )


def in_words(worst: dict[str, Any]) -> str:
    """``worst pose of the map: (300, 300, -200) mm, 932.5 µm in space under …, 57 % from z.foot …; 83 % of it …``."""
    at = ", ".join(f"{v / MM:.4g}" for v in worst["position"])
    named = zip(worst["shares"], percents(list(worst["shares"].values())), strict=True)
    parts = ", ".join(f"{share} % from {n}" for n, share in list(named)[:NAMED])
    rests = source_words(worst["sources"])
    return (
        f"worst pose of the map: ({at}) mm, {length_text(worst['deflection'])} in space under {worst['case']}; "
        f"{parts}{'; ' + rests if rests else ''}"
    )
