"""The worst pose of a map, and where its deflection comes from."""

from __future__ import annotations

from typing import Any

import numpy as np

from stiffmap.budget import deflection_budget
from stiffmap.cli.inputs import MM
from stiffmap.errors import StiffmapError
from stiffmap.machine import Machine

NAMED = 3
"""Elements that the sentence names."""


def worst_pose(machine: Machine, ds: Any, gravity: Any) -> dict[str, Any] | None:
    """Case, position (m), deflection (m) and shares of the elements at the largest deflection of all load cases.

    None where no pose has an answer, or its deflection none to share.
    """
    size = ds.deflection.transpose("z", "y", "x", "case").values
    if not np.isfinite(size).any():
        return None
    k, j, i, c = np.unravel_index(int(np.nanargmax(size)), size.shape)
    p = [float(ds[a].values[n]) for a, n in (("x", i), ("y", j), ("z", k))]
    case = str(ds.case.values[c])
    try:
        found = deflection_budget(machine, p, ds.wrench.sel(case=case).values, gravity=gravity)
    except StiffmapError:
        return None
    shares = {n: s for n, _, s in found.ranked()}
    return {"case": case, "position": p, "deflection": float(size[k, j, i, c]), "shares": shares}


def in_words(worst: dict[str, Any]) -> str:
    """``worst pose under Fx: (300, 300, -200) mm, 930.1 µm in space, of which 57 % z.foot, 20 % z.actuator …``."""
    at = ", ".join(f"{v / MM:.4g}" for v in worst["position"])
    parts = ", ".join(f"{100 * s:.0f} % {n}" for n, s in list(worst["shares"].items())[:NAMED])
    return f"worst pose under {worst['case']}: ({at}) mm, {1e6 * worst['deflection']:.1f} µm in space, of which {parts}"
