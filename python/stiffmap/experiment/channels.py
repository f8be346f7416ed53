"""What one row of an experiment may read: the six axes of a pose, a distance, joint coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

AXES = ("dx", "dy", "dz", "rx", "ry", "rz")
SIDES = ("load", "motor")


@dataclass(frozen=True)
class Channel:
    """One column of readings.

    joint, side
        Full name of the joint that an encoder reads. ``load``: the joint itself, behind the drive's
        elasticity; ``motor``: before it, so that a rigidly held motor reads nothing.
    """

    name: str
    unit: str
    """``m`` or ``rad``."""
    joint: str = ""
    side: str = "load"


AXIS_CHANNELS = tuple(Channel(a, "m" if a[0] == "d" else "rad") for a in AXES)


def metres(channels: tuple[Channel, ...]) -> NDArray[np.bool_]:
    """(c,) which channels are lengths."""
    return np.array([c.unit == "m" for c in channels])
