"""Which assembly mode: joint coordinates from which a closure starts."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats, trailing
from stiffmap.common.errors import StiffmapError
from stiffmap.solve.compiled import CompiledMachine

Start = ArrayLike | Mapping[str, ArrayLike]
"""Coordinates (..., coordinates) as `Solution.coordinates` has them, or joint name -> (...) m or rad."""


def start_coordinates(machine: CompiledMachine, start: Start) -> Floats:
    """(..., coordinates): joints that a mapping leaves out are as at home; StiffmapError for an unknown joint."""
    names = machine.names
    n = len(names.coordinates)
    if not isinstance(start, Mapping):
        return trailing(start, (n,), "start", f"{n} coordinates or joint name -> value")
    values = {}
    for name, value in start.items():
        if name not in names.joints:
            raise StiffmapError(f"start: expected joints among {', '.join(names.joints)}, got {name!r}")
        values[name] = trailing(value, (), f"start[{name!r}]", "numbers (m or rad)")
    shape = np.broadcast_shapes(*(v.shape for v in values.values()))
    out = np.tile(machine.home_coordinates(), (*shape, 1))
    for name, v in values.items():
        out[..., names.joints[name]] = v
    return out
