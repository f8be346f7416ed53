"""Where a state is: its box, its orientation, which directions the machine can take."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.compiled import Status
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.machine import Machine
from stiffmap.solve.solution import Solution
from stiffmap.ui.view.state import ViewState

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


def orientation(state: ViewState) -> Floats | None:
    """(3, 3) of a state; None: as at home."""
    return None if state.rotation is None else np.asarray(Rotation.from_rotvec(state.rotation).as_matrix())


def solved(
    machine: Machine,
    state: ViewState,
    position: ArrayLike | None = None,
    *,
    stiffness: bool = True,
    threads: int | None = None,
) -> Solution:
    """Under the load of a state, at its pose or at positions (..., 3) m with its orientation."""
    return machine.solve(
        state.position if position is None else position, state.wrench, rotation=orientation(state),
        gravity=state.gravity, start=state.start_array, stiffness=stiffness, threads=threads,
    )  # fmt: skip


def rotation_of(machine: Machine, state: ViewState) -> Floats:
    """(3, 3) commanded orientation."""
    turned = orientation(state)
    return np.asarray(machine.compiled.home_rotation if turned is None else turned)


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


def first_plane(machine: Machine) -> str:
    """The plane with the most commanded axes: z before y before x."""
    free = moves(machine)
    return max("zyx", key=lambda a: sum(free[i] for i in range(3) if "xyz"[i] != a))
