"""The value at one point, solved there, not read off the picture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.status import Status
from stiffmap.ui.view.moment import Moment
from stiffmap.ui.view.plane import Frame, values_at


def probe(moment: Moment, point: Sequence[float]) -> tuple[float, Status]:
    """Value (SI) of the state's quantity with the tool at a point (3,) m, and the status there."""
    value, status = values_at(moment.machine, moment.state, np.array(point, dtype=float))
    return float(value), Status(int(status))


def under_ray(frame: Frame, origin: Floats, direction: Floats) -> Floats | None:
    """(3,) where a ray (m) meets the rectangle of a plane; None where it misses."""
    across = float(np.dot(direction, frame.normal))
    if abs(across) < 1e-9:
        return None
    t = float(np.dot(frame.centre - origin, frame.normal)) / across
    point = np.asarray(origin) + t * np.asarray(direction)
    a, b = frame.coordinates(point)
    inside = abs(a) <= frame.width / 2 and abs(b) <= frame.height / 2
    return np.asarray(point) if t > 0 and inside else None
