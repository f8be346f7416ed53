"""Where a machine can be: its box, and which directions it can take."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.compiled import Status
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.machine import Machine

SMALL_TURN = 0.03
"""rad, with which it is tried whether a machine turns."""
DEFAULT_BOX = 0.25
"""Of the machine's length, half edge of the box of a machine that declares none."""
WIDE = 0.5
"""Of the longest commanded edge of the box, edge of the plane along what is not commanded."""


def box_of(machine: Machine) -> tuple[Floats, Floats]:
    """Lowest and highest corner (m): the workspace of the file, else a cube about home."""
    if machine.description.workspace is not None:
        low, high = machine.workspace
        return low, high
    home = machine.description.home.p
    half = DEFAULT_BOX * machine.compiled.length
    return home - half, home + half


def drawn_box(machine: Machine) -> tuple[Floats, Floats]:
    """The box of the plane: where an axis is not commanded, wide enough to see the colours, which it does not change."""
    low, high = (v.copy() for v in box_of(machine))
    free = np.array(moves(machine))
    if free.any():
        least = WIDE * float((high - low)[free].max())
        for i in np.flatnonzero(~free & (high - low < least)):
            middle = machine.description.home.p[i]
            low[i], high[i] = middle - least / 2, middle + least / 2
    return low, high


@lru_cache(maxsize=32)
def turns(machine: Machine) -> tuple[bool, bool, bool]:
    """About which axes of the tool the machine can turn near home."""
    home = machine.description.home
    steps = [Rotation.from_rotvec(SMALL_TURN * e).as_matrix() for e in np.eye(3)]
    named = [f"r{a}" in machine.description.task for a in "xyz"]
    k = inverse_kinematics(machine, home.p, np.array([home.r @ s for s in steps]))
    good = np.asarray(k.status) == Status.CONVERGED
    x, y, z = (bool(n and g) for n, g in zip(named, good, strict=True))
    return x, y, z


def moves(machine: Machine) -> tuple[bool, bool, bool]:
    """Along which base axes the tool is commanded."""
    x, y, z = (a in machine.description.task for a in "xyz")
    return x, y, z
