"""The quantity of the plane over the whole workspace box."""

from __future__ import annotations

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.ui.view.moment import Moment
from stiffmap.ui.view.place import box_of, moves
from stiffmap.ui.view.plane import values_at
from stiffmap.ui.view.quantities import QUANTITIES

NODES = 15
"""Along each commanded axis."""


def box_cloud(moment: Moment) -> tuple[Floats, Floats]:
    """Points (n, 3) m and values (n,) in the unit of the screen; quantities that need modes have none."""
    m, s = moment.machine, moment.state
    quantity = QUANTITIES[s.quantity]
    if quantity.of is None:
        return np.zeros((0, 3)), np.zeros(0)
    low, high = box_of(m)
    axes = [
        np.linspace(low[i], high[i], NODES) if free else np.array([s.position[i]])
        for i, free in enumerate(moves(m))
    ]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return points, values_at(m, s, points)[0] * quantity.factor
