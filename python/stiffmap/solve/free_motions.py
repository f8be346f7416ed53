"""Motions that nothing holds, in words."""

from __future__ import annotations

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.machine import Machine

NAMES = "xyz"


def twist_words(twist: Floats, length: float) -> str:
    """``turn about z`` or ``move along x`` for a twist (6,), m and rad."""
    v, w = twist[:3], twist[3:]
    if np.linalg.norm(w) * length > 0.1 * np.linalg.norm(v):
        moved = " and shift with it" if np.linalg.norm(v) > 0.1 * np.linalg.norm(w) * length else ""
        return f"turn about {direction(w)}{moved}"
    return f"move along {direction(v)}"


def direction(v: Floats) -> str:
    """An axis by its name, or the vector."""
    u = v / np.linalg.norm(v)
    main = int(np.argmax(np.abs(u)))
    if abs(u[main]) > 0.999:
        return NAMES[main]
    return f"({', '.join(f'{c:.2g}' for c in u)})"


def free_motions(machine: Machine, free_twists: Floats) -> list[str]:
    """The free twists of a singular pose (6, 6), columns, in words."""
    columns = [c for c in free_twists.T if np.isfinite(c).all()]
    return [twist_words(c, machine.compiled.length) for c in columns]
