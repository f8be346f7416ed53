"""Modes that a machine should show in a tap test, paired with those that were found by direction and frequency (MAC)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linear_sum_assignment

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.identification.taps.table import TapTest
from stiffmap.solve.machine import Machine, takes_machine
from stiffmap.workspace.vibration.modes import tip_modes

OCTAVE = 0.35
"""Difference of the logarithms of two frequencies that weighs as much as directions at right angles."""
NEAR = 0.05
"""Difference of the logarithms of two frequencies within which small errors of the machine mix the directions of two modes: together
they then count as one plane of directions, and frequency decides."""
SEEN = 1e-6
"""Share of the largest motion at the tool from which on a mode can be seen there."""


@dataclass(frozen=True, eq=False)
class Predicted:
    """For each row of a tap test the mode that it is; NaN where the machine has none left for it."""

    frequency: Floats
    """(n,) Hz."""
    ratio: Floats
    """(n,) damping ratio, declared or assumed."""
    mac: Floats
    """(n,) square of the cosine between the directions; NaN where none was measured."""


@takes_machine
def predict_taps(
    machine: Machine, taps: TapTest, *, gravity: ArrayLike | None = None, modes: int = 16
) -> Predicted:
    """Frequencies that the machine should show at the poses of a tap test.

    Modes are paired at each pose so that directions (MAC of the tool's motion) and frequencies agree best together, never by their
    order: modes that cross are kept apart. Raises StiffmapError for bad input.
    """
    once, back = taps.poses
    found = tip_modes(machine, once, gravity=gravity, modes=modes)
    f, ratio = np.full(len(taps), np.nan), np.full(len(taps), np.nan)
    mac = np.full(len(taps), np.nan)
    for k in range(len(once)):
        rows = np.flatnonzero(back == k)
        b = found.tip[k, :3]
        size = np.linalg.norm(b, axis=0)
        if not np.isfinite(size).all():
            continue
        seen = np.flatnonzero((size > SEEN * size.max(initial=0.0)) & (found.square[k] > 0))
        way, hertz = (b[:, seen] / size[seen]).T, found.frequency[k, seen]
        cosine = (taps.direction[rows] @ way.T) ** 2
        near = np.exp(-0.5 * (np.log(hertz[:, None] / hertz) / NEAR) ** 2)
        alike = np.minimum(1.0, cosine @ near)
        apart = (np.log(taps.frequency[rows, None] / hertz) / OCTAVE) ** 2
        mine, theirs = linear_sum_assignment(np.where(np.isnan(alike), 0.0, 1 - alike) + apart)
        f[rows[mine]], ratio[rows[mine]] = hertz[theirs], found.ratio[k, seen[theirs]]
        mac[rows[mine]] = cosine[mine, theirs]
    if np.isnan(f).all():
        raise StiffmapError(
            f"{machine.name}: no pose of the tap test can be reached, or none has a mode at the tool"
        )
    return Predicted(f, ratio, mac)
